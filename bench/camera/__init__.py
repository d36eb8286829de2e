"""What a camera needs before its recordings: printed markers and boards, and a calibration's picture and words."""
