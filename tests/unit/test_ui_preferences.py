"""Settings: remembered, brought back into range, and set aside when damaged."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.edit.preferences import (
    MAX_RECENT,
    Settings,
    WindowPlace,
    config_dir,
    layout_file,
    load_settings,
    save_settings,
)
from spectrasplat.edit.state import Panels, Preferences


@pytest.fixture(autouse=True)
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "config"))
    return tmp_path / "config"


def test_the_folder_is_the_one_named_and_made_on_demand(config: Path) -> None:
    assert not config.exists()
    assert config_dir() == config and config.is_dir() and layout_file().parent == config


def test_settings_come_back_as_they_were(tmp_path: Path) -> None:
    assert load_settings() == (Settings(), None)
    preferences = Preferences("light", 1.5, 5_000_000, False, Panels(abbe=True, timing=False))
    settings = Settings(preferences, (tmp_path / "ä b.toml",), WindowPlace((-3, 20), (800, 600), True))
    save_settings(settings)
    assert load_settings() == (settings, None)


def test_recent_files_are_ten_newest_first_and_only_those_still_there(tmp_path: Path) -> None:
    files = [tmp_path / f"{i}.toml" for i in range(12)]
    settings = Settings()
    for file in files:
        file.write_text("", encoding="utf-8")
        settings = settings.opened(file)
    settings = settings.opened(files[5])
    assert settings.recent[:3] == (files[5], files[11], files[10]) and len(settings.recent) == MAX_RECENT
    files[11].unlink()
    assert settings.existing_recent()[:2] == (files[5], files[10]) and files[11] in settings.recent


@pytest.mark.parametrize(
    "content", [b"{", b"\xff\xfe", b'{"preferences": {"theme": "pink"}}', b'{"recent": 3}', b"[" * 100_000, b""]
)
def test_a_damaged_file_is_set_aside_and_told(config: Path, content: bytes) -> None:
    config.mkdir()
    (config / "settings.json").write_bytes(content)
    settings, notice = load_settings()
    assert settings == Settings() and notice is not None and "settings.broken.json" in notice
    assert (config / "settings.broken.json").read_bytes() == content
    assert load_settings() == (Settings(), None)


def test_values_that_would_hide_the_interface_are_brought_back(config: Path) -> None:
    wild = Settings(replace(Preferences(), ui_scale=1e9, target_photons=-5), window=WindowPlace(size=(1, 1)))
    save_settings(wild)
    settings, notice = load_settings()
    assert notice is None and settings.preferences.ui_scale == 4.0 and settings.preferences.target_photons == 10_000
    assert settings.window.size == (320, 240)


def test_keys_of_a_newer_version_do_no_harm(config: Path) -> None:
    config.mkdir()
    (config / "settings.json").write_text('{"preferences": {"theme": "light", "sound": true}}', encoding="utf-8")
    settings, notice = load_settings()
    assert notice is None and settings.preferences == replace(Preferences(), theme="light")


def test_a_folder_that_cannot_be_made_is_told(config: Path) -> None:
    config.write_text("not a folder", encoding="utf-8")
    settings, notice = load_settings()
    assert settings == Settings() and notice is not None and "not remembered" in notice
    with pytest.raises(UserError, match="SPECTRASPLAT_CONFIG"):
        save_settings(settings)


def test_recent_files_that_are_no_text_are_not_remembered_and_break_nothing(config: Path) -> None:
    odd = Path(os.fsdecode(b"/tmp/\xff.toml"))
    save_settings(Settings().opened(Path("/tmp/a.toml")).opened(odd))
    assert load_settings()[0].recent == (Path("/tmp/a.toml"),)
    (config / "settings.json").write_text('{"recent": [1, null]}', encoding="utf-8")
    settings, said = load_settings()
    assert settings == Settings() and "damaged" in (said or "")
    long = Settings(recent=(Path("/" + "a" * 300), Path("/tmp/a\0b")))
    assert long.existing_recent() == ()
