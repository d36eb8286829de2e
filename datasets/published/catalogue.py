"""Catalogue of published logs: their sources, and their place on this machine once fetched.

None of them is part of this package. The addresses are the publishers' own, with notes on their status. A file of known
sha256 is accepted only if it matches, from any source; the digests are of copies that this package's readers are tested
with. Of the other files the names are known, so that missing ones are detected, and their digests are recorded on first
arrival.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ...core.errors import Absent
from ...core.files import cache_folder


@dataclass(frozen=True)
class Published:
    """A published log.

    `urls` are tried in order; with a `link`, they are pages, and the links on them that match this regular expression
    are tried. One with FILE in it is the address of each file by itself, with its name in that place. `files` are the
    names that must be found, each with its sha256, or None if unknown. `archive` is the sha256 of the download as
    reported by others, which is shown but not enforced. `by_hand` ends the sentence "open `page` and ...". `goes_by` is
    a regular expression for names of its archive and of the folder in it, for logs whose files have the same names as
    another's. `also` are names that a file has elsewhere; gzipped ones are unpacked. `spare` are files that a copy may
    lack: the log is read without them. A download of more than `largest` bytes is something else.
    """

    title: str
    citation: str
    licence: str
    page: str
    urls: tuple[str, ...]
    addresses: str
    by_hand: str
    files: Mapping[str, str | None]
    link: str = ""
    archive: str | None = None
    goes_by: str = ""
    also: Mapping[str, str] = field(default_factory=dict[str, str])
    spare: Collection[str] = ()
    largest: int = 2**30


FILE = "{file}"  # stands in an address for the name of a file

_NONE_SEEN = "none stated with the copies seen; ask the authors before passing it on"

_MRCLAM_6 = {
    "Barcodes.dat": "3448dfa8fdf7c6e52c4d778c9e3166a704fc1b3f388e5f274532ff1af3b37362",
    "Landmark_Groundtruth.dat": "eae8cb0aed1ad57910578ece4288d861940427cef95551fd53ca3997f16ecdb1",
    "Robot1_Groundtruth.dat": "fee9661b3415b162e948c02cf56d3646ddc751c70f22c8cbd431fcde6d8a7b76",
    "Robot1_Measurement.dat": "571ca6c9978df9503062e014b0e46101623523d46a64dfe789e8aa1792b0e2e3",
    "Robot1_Odometry.dat": "575febdf8022bd0a0da163e5078bb27413165196afe657974437aad215be5d0b",
    "Robot2_Groundtruth.dat": "793fa0860e95a8b3d8422ae94614541649e895e89d7ab68c2d05e98965d1dc91",
    "Robot2_Measurement.dat": "36aaf4bde8f4880096f10324b490c0156e8ca71583375770a6fd0e725237fa04",
    "Robot2_Odometry.dat": "dde2e7d70a8ff9355038d38e3e38a06419e060bff96607778506a01d90089701",
    "Robot3_Groundtruth.dat": "1fffc5b2ff732a4bfd617ee35796f67ff6300eafcf3de0d645e3049df035fce8",
    "Robot3_Measurement.dat": "1975db530c0dfa3c215333cdc9432428bd6c3cb12348cd4aab12ed8a30f8dc1c",
    "Robot3_Odometry.dat": "a4c50b28fd9fe8a4e4830ff53cbb7812a52fe2d88f2258c66e275232fb3c7326",
    "Robot4_Groundtruth.dat": "eaba04bcb96f72f67aeb7e1098a994ac739e699cd03f0cfa21fd083a63a7f3d4",
    "Robot4_Measurement.dat": "b0d87a0d8c5bae9f761c42494a0d7f7d1ac48df4922a6af72811e2f2b82a063c",
    "Robot4_Odometry.dat": "b5270104419bbb5b1e5ddf8d7bb31b6f4496a55f0d1b643b743af62ad06a31d6",
    "Robot5_Groundtruth.dat": "fd98a23d555782ccad449d3cd4ff61e252891b6968248e68882b8cb6bfd4875c",
    "Robot5_Measurement.dat": "4f8bf6b4421a97b093503f6526365ae38f5d61361507c8bf1b0ad002a4c2e00e",
    "Robot5_Odometry.dat": "11297ae2f083f6d394f093b690ff4b467d3e466ab99525b9f02ee0fa4d15d817",
}

_OF_ROBOTS = [file for file in _MRCLAM_6 if file.endswith(("_Groundtruth.dat", "_Odometry.dat")) and "Robot" in file]
"""Copies without the paths, and set 3 without robot 4's odometry, are passed on."""

_MRCLAM_ARCHIVES = {
    1: "57c0166b0e2761680e83ffa67b4f58bad7187c41fd723345a4a45ebd50a6557e",
    9: "013714987dc0f797853689a80146da1fee50478ad884491d0eeac5f6357602d4",
}


def _mrclam(number: int) -> Published:
    return Published(
        title=f"UTIAS MRCLAM, set {number}: five robots, 15 landmarks, motion-capture truth",
        citation="Leung, Halpern, Barfoot and Liu, The UTIAS multi-robot cooperative localization and mapping dataset, "
        "IJRR 30(8):969-974, 2011",
        licence=_NONE_SEEN,
        page="http://asrl.utias.utoronto.ca/datasets/mrclam/index.html",
        urls=(f"ftp://asrl3.utias.utoronto.ca/MRCLAM/MRCLAM{number}.zip",),
        addresses="this is the FTP server that public scripts download the sets from",
        by_hand=f"download set {number} (MRCLAM{number}.zip)",
        files=_MRCLAM_6 if number == 6 else dict.fromkeys(_MRCLAM_6),
        archive=_MRCLAM_ARCHIVES.get(number),
        goes_by=rf"MR[CS]LAM[ _-]?(Dataset)?[ _-]?{number}(?!\d)",  # set 4 stands in MRSLAM_Dataset4
        spare=[] if number == 6 else _OF_ROBOTS,
    )


def _gzipped(*files: str) -> dict[str, str]:
    """The names of these files where they are gzipped, each with the file's own."""
    return {f"{file}.gz": file for file in files}


_SLAM_EVALUATION = "http://ais.informatik.uni-freiburg.de/slamevaluation"

_RELATIONS = {
    "fr079": "7e7f06b4aca455cb68f1f23d04e7c7316c5e17773e872734c860ed7a274cdfc7",
    "intel": "330378f153eeae652d6756c1746f335801f66c3e097d90611548e6c4f593c359",
    "mit-killian": "0b0f8dfc0746f9dee20b9d6d2a47a805674fd2f5be94f0ba11876bc6e97fab4b",
}
"""sha256 of the relations in public copies."""


def _laser(stem: str, title: str, recorded_by: str) -> Published:
    """A laser log of the Freiburg SLAM benchmark with its relations."""
    return Published(
        title=title,
        citation=f"{recorded_by}; relations: Kuemmerle et al., On measuring the accuracy of SLAM algorithms, "
        "Autonomous Robots 27(4):387-407, 2009",
        licence="none stated; given for research, with credit to who recorded it",
        page=f"{_SLAM_EVALUATION}/datasets.php",
        urls=(f"{_SLAM_EVALUATION}/datasets/{FILE}",),
        addresses="public scripts download the files from there one by one",
        by_hand=f"download {stem}.clf and {stem}.relations into a folder",
        files={f"{stem}.clf": None, f"{stem}.relations": _RELATIONS.get(stem)},
        also=_gzipped(f"{stem}.clf", f"{stem}.relations"),
    )


def _pioneer(run: str, about: str) -> Published:
    """A drive of TUM's robot with a Kinect; only the bag has the wheels."""
    stem = f"rgbd_dataset_freiburg2_pioneer_{run}"
    return Published(
        title=f"TUM RGB-D, fr2/pioneer_{run}: a robot with a depth camera, {about}, motion-capture truth",
        citation="Sturm, Engelhard, Endres, Burgard and Cremers, A benchmark for the evaluation of RGB-D SLAM systems, "
        "IROS 2012",
        licence="CC BY 4.0",
        page="https://cvg.cit.tum.de/data/datasets/rgbd-dataset/download",
        urls=(f"https://cvg.cit.tum.de/rgbd/dataset/freiburg2/{stem}.bag",),
        addresses="this is where the benchmark's page has the bags",
        by_hand=f"download {stem}.bag, of several gigabytes",
        files={f"{stem}.bag": None},
        largest=2**35,
    )


_ISAM = (
    "https://github.com/ori-drs/isam/archive/c977f3d031af5f0ad742054095f79d050a00ffe2.zip",
    "https://github.com/ori-drs/isam/archive/refs/heads/master.zip",
    "https://github.com/qh-huang/iSAM/archive/669fc794cc511b2cbec901f45eb093c0dbf66f2c.zip",
)


_KAESS = (
    "H. Johannsson and M. Kaess; Kaess et al., iSAM2: incremental smoothing and mapping using the Bayes tree, "
    "IJRR 31(2):216-235, 2012"
)


def _isam(stem: str, title: str, citation: str, graph: str, truth: str) -> Published:
    """A simulated pose graph of iSAM's repository, with its truth; `graph` and `truth` are the sha256 of both."""
    plain, right, short = f"{stem}.txt", f"{stem}_groundtruth.txt", f"{stem}_gt.txt"
    return Published(
        title=title,
        citation=citation,
        licence="LGPL-2.1, of iSAM, which has this copy",
        page="https://github.com/ori-drs/isam/tree/master/data",
        urls=_ISAM,
        addresses="the repositories are iSAM's on GitHub and a copy of it; their archives, all of each, were not tried",
        by_hand=f"download {plain} and {right} into a folder",
        files={plain: graph, right: truth},
        also=_gzipped(plain, right) | {short: right, f"{short}.gz": right},
    )


PUBLISHED: dict[str, Published] = {
    "aces": _laser("aces", "ACES building, Austin: laser scans and odometry, relations", "P. Beeson"),
    "city10000": _isam(
        "city10000",
        "City10000: 10,000 simulated poses in a city, 10,688 loop closures, with truth",
        _KAESS,
        "7b2885aa3f76e0ce513c1a4ea270557d5c884509064f4e1678adf215a2ec105a",
        "ebdf93eaeb3498dcebc7ba0b88ff6a3dc86d06767b1e42c166d686d7323051ab",
    ),
    "city-trees10000": _isam(
        "cityTrees10000",
        "CityTrees10000: 10,000 simulated poses among 100 trees, 4,443 sightings, with truth",
        _KAESS,
        "62760029d3b492f357117a3922b57a68585b137fbcb7a115def597ab7a4f2c24",
        "0ff138c64003d0fcf7a8d864a99de4d98d57f7b487096fa81abd7f53a8b63c04",
    ),
    "dlr": Published(
        title="DLR Spatial Cognition: a camera, circles on the floor, wheel odometry; one building, no truth",
        citation="Kurlbaum and Frese, A Benchmark Data Set for Data Association, DLR and University of Bremen",
        licence=_NONE_SEEN,
        page="https://www.informatik.uni-bremen.de/agebv/en/DlrSpatialCognitionDataSet",
        urls=tuple(
            f"https://www.informatik.uni-bremen.de/{group}/en/DlrSpatialCognitionDataSet"
            "?action=AttachFile&do=get&target=DLR-Spatial_Cognition_noimages.tar.gz"
            for group in ("agebv", "agmsis")
        ),
        addresses="the wiki is known to have this archive, but not if its map.circles is the one expected here",
        by_hand="download the data set without images, or the file map.circles itself",
        files={"map.circles": "a6a849755dc13768bb31233964ccbd0b8cfd48f5ffc42c6cf73f7ab2a9851563"},
    ),
    "fr079": _laser("fr079", "Freiburg, building 079: laser scans and odometry, relations", "C. Stachniss"),
    "freiburg": Published(
        title="Robot Mapping course, EKF SLAM sheet: simulated, nine landmarks with truth",
        citation="Stachniss, Robot Mapping, University of Freiburg, WS 2013/14",
        licence=_NONE_SEEN,
        page="http://ais.informatik.uni-freiburg.de/teaching/ws13/mapping/index_en.php",
        urls=(
            "http://ais.informatik.uni-freiburg.de/teaching/ws13/mapping/index_en.php",
            "https://web.archive.org/web/20191216041354/http://ais.informatik.uni-freiburg.de/teaching/ws13/mapping/index_en.php",
        ),
        addresses="the page and its archived copy are known, the archive itself is not: likely links are tried",
        by_hand="download the framework of the EKF SLAM sheet (data/sensor_data.dat and data/world.dat in it)",
        files={
            "sensor_data.dat": "b585f3ab19c7e16b571b614762ac6d4c1b0db7ca2ec2f60b7dc2b3284e20d49a",
            "world.dat": "35401a34be49bdb24333efa7ad4ef680c073ec58096a4393be36a03718454253",
        },
        link=r"ekf[^/]*\.(zip|tgz|tar\.gz)$",
    ),
    "intel-lab": _laser("intel", "Intel Research Lab, Seattle: laser scans and odometry, relations", "D. Haehnel"),
    "killian": _laser(
        "mit-killian", "MIT, Killian Court: laser scans and odometry over 1.9 km, relations", "M. Bosse and J. Leonard"
    ),
    "lost-in-the-woods": Published(
        title="Lost in the woods: a wheeled robot with a laser scanner among 17 tubes, motion-capture truth",
        citation="T. D. Barfoot, State estimation for aerospace vehicles - AER1513 course assignments, "
        "github.com/utiasASRL/aer1513",
        licence="Apache-2.0",
        page="https://github.com/utiasASRL/aer1513",
        urls=(
            "https://github.com/utiasASRL/aer1513/archive/491190c5ecf64d895dad9675625adc51d6516f13.zip",
            "https://github.com/utiasASRL/aer1513/archive/refs/heads/master.zip",
        ),
        addresses="the repository is the publisher's on GitHub; the archives of all of it were not tried",
        by_hand="download dataset2.mat",
        files={"dataset2.mat": "bbaeae95687376f115c9a8bf637097c65ce275f3bc66cc2cd8cd2755608682d9"},
    ),
    "manhattan": _isam(
        "manhattanOlson3500",
        "Manhattan: 3,500 simulated poses on a grid, 2,099 loop closures, with truth",
        "Olson, Leonard and Teller, Fast iterative alignment of pose graphs with poor initial estimates, ICRA 2006",
        "cbca9a57a97e43b8a32e3d76d7c78d285e2719aae08fa005d601feb0573c7bbf",
        "058854bc5943514dea9b40559df56bfb82e8d78261eb8227a9a725c4a7d0d533",
    ),
    "mit-csail": _laser("mit-csail", "MIT, CSAIL building: laser scans and odometry, relations", "C. Stachniss"),
    **{f"mrclam-{number}": _mrclam(number) for number in range(1, 10)},
    "tum-pioneer-360": _pioneer("360", "turning in a hall"),
    "tum-pioneer-slam": _pioneer("slam", "through a hall of tables and partitions"),
    "tum-pioneer-slam2": _pioneer("slam2", "through the same hall"),
    "tum-pioneer-slam3": _pioneer("slam3", "through the same hall again"),
    "victoria-park-raw": Published(
        title="Victoria Park as recorded: a car, trees found by a laser, without ids; GPS as truth",
        citation="Guivant and Nebot, Optimization of the simultaneous localization and map-building algorithm for "
        "real-time implementation, IEEE Trans. Robotics and Automation 17(3), 2001",
        licence="New BSD, of RFS-SLAM, which has this copy; none stated with the recording",
        page="https://github.com/kykleung/RFS-SLAM/tree/aa5170b/data/VictoriaPark",
        urls=("https://github.com/kykleung/RFS-SLAM/archive/aa5170b.zip",),
        addresses="the repository has these files at this commit; its archive, all of it, was not tried",
        by_hand="download inputs.dat, measurements.dat and gps.dat into a folder",
        files={
            "inputs.dat": "94353fa7a529f8a9e9770e69363d27472fe414f3637a107dce54a7f8db96e7d8",
            "measurements.dat": "b0737e2d312cbb80d466a8f1d6048e11dd06939a5ffb63becc8b954cde149746",
            "gps.dat": "944657cdaacdb9c421bf3a7ec1af95f05a8b9fefb513374f1f617bacc5426c07",
        },
        also=_gzipped("inputs.dat", "measurements.dat", "gps.dat"),
    ),
}
"""Name -> catalogue entry."""


def named_in(path: str) -> str | None:
    """The published log named by `path`, the innermost if several; None if there is none."""
    found = [
        (match.start(), name)
        for name, log in PUBLISHED.items()
        if log.goes_by
        for match in re.finditer(log.goes_by, path, re.IGNORECASE)
    ]
    return max(found)[1] if found else None


def place(name: str) -> Path:
    """The folder of the published log `name` once fetched; it may not exist yet."""
    return cache_folder() / "published" / name


def fetched(name: str, given: str) -> Path:
    """The folder of the published log `name`; Absent, with instructions, if it is not on this machine.

    `given` is the alternative that names a copy elsewhere: `dlr[path=FOLDER]`.
    """
    found = place(name)
    if not found.is_dir():
        raise Absent(f"{name} is not on this machine: bench fetch {name} gets it, {given} names a copy.")
    return found
