"""Which peculiarities a renderer is known by."""

from __future__ import annotations

import time

from spectrasplat.gpu.device_traits import DeviceTraits, assumed, is_software_renderer


def test_llvmpipe_has_all_of_them() -> None:
    traits = DeviceTraits.of("llvmpipe (LLVM 15.0.6, 256 bits)")
    assert traits.is_software and traits.texels_as_images and traits.loops_may_end and not traits.work_is_queued
    assert traits.queue_read_steps == 1 and traits.clock is time.process_time
    assert traits.paths_group == 8 < DeviceTraits().paths_group
    assert traits.viewer_batch < DeviceTraits().viewer_batch


def test_other_software_reads_textures() -> None:
    traits = DeviceTraits.of("Google SwiftShader")
    assert traits.is_software and not traits.texels_as_images


def test_a_card_has_none() -> None:
    assert DeviceTraits.of("NVIDIA H100/PCIe/SSE2") == DeviceTraits()
    assert DeviceTraits().clock is time.perf_counter


def test_what_is_assumed_does_not_hide_a_software_renderer() -> None:
    with assumed(DeviceTraits(splats_by_compute=True)):
        assert (
            is_software_renderer("llvmpipe (LLVM 15.0.6, 256 bits)") and DeviceTraits.of("llvmpipe").splats_by_compute
        )
    assert not is_software_renderer("NVIDIA H200/PCIe/SSE2") and not DeviceTraits().splats_by_compute
