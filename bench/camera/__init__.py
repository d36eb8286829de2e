"""Things that a camera needs before its recordings: printed markers and boards, and the page of a calibration."""
