"""Interface tests never touch the user's settings."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def own_config(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A config folder for the whole run; a test that sets its own overrides it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path_factory.mktemp("config")))
        yield
