"""What a driver has: traits of renderers, limits, better devices that are there."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.gpu.better_device import NVIDIA_EGL, Machine, advice
from spectrasplat.gpu.device_traits import DeviceTraits, assumed, is_software_renderer
from spectrasplat.gpu.limits import BRUSH_STORAGE_BLOCKS, NEEDED, check_brush, check_splats


def test_llvmpipe_has_all_of_them() -> None:
    traits = DeviceTraits.of("llvmpipe (LLVM 15.0.6, 256 bits)")
    assert traits.is_software and traits.texels_as_images and traits.loops_may_end and not traits.work_is_queued
    assert not traits.ray_events and traits.clock is time.process_time
    assert traits.paths_group == 8 < DeviceTraits().paths_group
    assert traits.viewer.batch < DeviceTraits().viewer.batch


def test_other_software_reads_textures() -> None:
    traits = DeviceTraits.of("Google SwiftShader")
    assert traits.is_software and not traits.texels_as_images


def test_a_card_has_none() -> None:
    assert DeviceTraits.of("NVIDIA H100/PCIe/SSE2") == DeviceTraits()
    assert DeviceTraits().clock is time.perf_counter


def test_what_is_assumed_does_not_hide_a_software_renderer() -> None:
    with assumed(DeviceTraits(splats_by_compute=True)):
        assert is_software_renderer("llvmpipe (LLVM 15.0.6, 256 bits)")
        assert DeviceTraits.of("llvmpipe").splats_by_compute
    assert not is_software_renderer("NVIDIA H200/PCIe/SSE2") and not DeviceTraits().splats_by_compute


def test_what_is_needed_is_enough_for_splats() -> None:
    check_splats(NEEDED)
    check_brush(replace(NEEDED, storage_blocks=BRUSH_STORAGE_BLOCKS))


@pytest.mark.parametrize(
    ("name", "found", "words"),
    [
        ("vertex_storage_blocks", 0, "0 storage blocks in a vertex shader, and splats need 5"),
        ("storage_bindings", 8, "8 binding points of storage blocks"),
        ("storage_blocks", 4, "4 storage blocks in a compute shader"),
    ],
)
def test_too_few_are_told_with_a_remedy(name: str, found: int, words: str) -> None:
    with pytest.raises(UserError, match=words) as told:
        check_splats(replace(NEEDED, **{name: found}))
    assert "doctor" in str(told.value)


def test_the_brush_asks_for_more() -> None:
    with pytest.raises(UserError, match="local dispersion takes 10 storage blocks"):
        check_brush(NEEDED)


VENDOR = {"NVIDIA": "0x10de", "AMD": "0x1002", "Intel": "0x8086", "ASPEED": "0x1a03"}
LLVMPIPE = "llvmpipe (LLVM 15.0.6, 256 bits)"


class Rig:
    """A machine with the cards that a test puts in."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.environment: dict[str, str] = {}
        self.libraries: set[str] = set()

    def card(self, vendor: str, driver: str = "", kind: str = "0x030000") -> None:
        folder = self.root / "sys/bus/pci/devices" / f"0000:0{len(list(self.root.glob('sys/bus/pci/devices/*')))}:00.0"
        folder.mkdir(parents=True)
        (folder / "vendor").write_text(VENDOR[vendor] + "\n")
        (folder / "class").write_text(kind + "\n")
        if driver:
            (self.root / "sys/drivers" / driver).mkdir(parents=True, exist_ok=True)
            (folder / "driver").symlink_to(self.root / "sys/drivers" / driver)

    def file(self, name: str, text: str = "") -> Path:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def told(self, renderer: str = LLVMPIPE, software: bool = True) -> str:
        return advice(renderer, software, Machine(self.root, self.environment, self.libraries.__contains__))


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    return Rig(tmp_path)


def test_without_a_gpu_there_is_nothing_to_say(rig: Rig) -> None:
    assert rig.told() == ""
    rig.card("ASPEED", "ast")  # a server's console
    rig.card("NVIDIA", "snd_hda_intel", kind="0x040300")  # its sound
    assert rig.told() == ""


def test_a_variable_that_asks_for_software_is_named(rig: Rig) -> None:
    rig.environment["LIBGL_ALWAYS_SOFTWARE"] = "1"
    assert rig.told() == ""
    rig.card("AMD", "amdgpu")
    assert rig.told().endswith("LIBGL_ALWAYS_SOFTWARE=1 asks for it, so unset LIBGL_ALWAYS_SOFTWARE")


def test_nvidia_step_by_step(rig: Rig) -> None:
    rig.card("NVIDIA", kind="0x030200")
    assert "not loaded" in rig.told()
    rig.card("NVIDIA", "nvidia", kind="0x030200")
    only = Rig(rig.root / "second")
    only.card("NVIDIA", "nvidia", kind="0x030200")
    assert f"{NVIDIA_EGL} is not installed" in only.told()
    only.environment |= {"NVIDIA_VISIBLE_DEVICES": "all", "NVIDIA_DRIVER_CAPABILITIES": "compute,utility"}
    assert "NVIDIA_DRIVER_CAPABILITIES=all (it is 'compute,utility')" in only.told()
    only.libraries.add(NVIDIA_EGL)
    assert "10_nvidia.json" in only.told()
    only.file("usr/share/glvnd/egl_vendor.d/50_mesa.json", '{"ICD": {"library_path": "libEGL_mesa.so.0"}}')
    assert "write 10_nvidia.json" in only.told()
    file = only.file("usr/share/glvnd/egl_vendor.d/10_nvidia.json", f'{{"ICD": {{"library_path": "{NVIDIA_EGL}"}}}}')
    assert f"__EGL_VENDOR_LIBRARY_FILENAMES={file}" in only.told()


def test_a_container_that_hides_the_bus(rig: Rig) -> None:
    rig.file("dev/nvidia0")
    rig.file(".dockerenv")
    assert "NVIDIA_DRIVER_CAPABILITIES=all (it is 'not set')" in rig.told()


def test_mesa_step_by_step(rig: Rig) -> None:
    rig.card("AMD")
    assert "kernel driver is not loaded" in rig.told()
    other = Rig(rig.root / "second")
    other.card("Intel", "i915")
    assert "--device /dev/dri" in other.told()
    other.file("dev/dri/renderD128")
    assert "libgl1-mesa-dri" in other.told()


def test_a_laptops_lesser_gpu(rig: Rig) -> None:
    rig.card("Intel", "i915")
    intel = "Mesa Intel(R) UHD Graphics 620 (KBL GT2)"
    assert rig.told(intel, False) == ""
    rig.card("NVIDIA", "nvidia")
    assert "__NV_PRIME_RENDER_OFFLOAD=1" in rig.told(intel, False)
    assert "by AMD draws although there is one by NVIDIA" in rig.told("AMD Radeon 780M (radeonsi)", False)
    assert rig.told("NVIDIA H200/PCIe/SSE2", False) == ""
    assert rig.told("GeForce RTX 4090/PCIe/SSE2", False) == ""
    laptop = Rig(rig.root / "second")
    laptop.card("Intel", "i915")
    laptop.card("AMD", "amdgpu")
    assert laptop.told(intel, False).endswith("set DRI_PRIME=1")


def test_windows_subsystem(rig: Rig) -> None:
    rig.file("dev/dxg")
    assert "GALLIUM_DRIVER=d3d12" in rig.told()


def test_that_the_environment_makes_any_device_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPECTRASPLAT_DEVICE", "gpu")
    assert DeviceTraits.of("llvmpipe") == DeviceTraits(splats_by_compute=True, loops_may_end=True)
    assert DeviceTraits.of("NVIDIA H200/PCIe/SSE2") == DeviceTraits()
    monkeypatch.setenv("SPECTRASPLAT_DEVICE", "gpo")
    with pytest.raises(UserError, match="SPECTRASPLAT_DEVICE is 'gpo'.*did you mean 'gpu'"):
        DeviceTraits.of("llvmpipe")
