"""Files of a small world of one's own, for the dataset `world`."""

from pathlib import Path

LANDMARKS = "id,x,y\n3,1,1\n5,4,1\n8,4,4\n9,1,4\n12,6,2\n"
WAY_POINTS = "x,y\n0,0\n5,0\n5,5\n0,5\n"


def written(folder: Path, landmarks: str = LANDMARKS, way_points: str = WAY_POINTS) -> dict[str, str]:
    """Writes both files into `folder`; the dataset's options that read them."""
    folder.mkdir(parents=True, exist_ok=True)
    places = {"landmarks": folder / "landmarks.csv", "path": folder / "walk.csv"}
    for place, content in zip(places.values(), (landmarks, way_points), strict=True):
        place.write_text(content, encoding="utf-8")
    return {name: str(place) for name, place in places.items()}


def named(files: dict[str, str], *more: str) -> str:
    """The dataset as on the command line."""
    return f"world[{','.join([f'{name}={place}' for name, place in files.items()] + [*more])}]"
