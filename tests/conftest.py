"""What every test gets without asking."""

import pytest


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep prepared logs in a folder of the tests' own, which a whole session shares; the user's cache is untouched."""
    patch = pytest.MonkeyPatch()
    patch.setenv("SLAMDUEL_CACHE", str(tmp_path_factory.getbasetemp().parent / "cache"))
