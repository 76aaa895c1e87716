"""Records that the camera's shader reads: a light as rays meet it, and the parameters of one dispatch."""

from __future__ import annotations

import numpy as np

from ..gpu.scene_buffers import SceneBuffers
from ..gpu.schema import Field, Struct
from ..model.optics.colorimetry import xyz_to_rgb709_matrix
from ..model.scene import Camera, Light
from ..model.scene_camera import camera_frame

CAMERA_LIGHT = Struct(
    "CameraLight",
    (
        Field("position", "vec3", "GPU space"),
        Field("kind", "uint", "0 point, spot or measured, 1 directional, 2 collimated, 3 area"),
        Field("axis", "vec3", "unit, propagation"),
        Field("is_disc", "uint"),
        Field("half_u", "vec3", "centre to rim, GPU units; directional: tangent of the angular radius; profile: C0"),
        Field("measure", "float", "area: GPU units²; directional: radiance per irradiance (0: no extent); else 0"),
        Field("half_v", "vec3", "as half_u, across it"),
        Field("profile", "uint", "where its intensity table begins"),
        Field("cone", "vec2", "inner and outer half angle, rad"),
        Field("has_profile", "uint"),
        Field("reserved", "uint", ""),
    ),
)
CAMERA_PARAMETERS = Struct(
    "CameraParameters",
    (
        Field("position", "vec3", "camera, GPU space"),
        Field("orthographic", "uint"),
        Field("forward", "vec3", "unit"),
        Field("first_row", "uint", "row of this dispatch's first pixels"),
        Field("half_right", "vec3", "picture's middle to its right border"),
        Field("sample_index", "uint", "counts the samples of a pixel: which stretch of the spectrum this one sees"),
        Field("half_up", "vec3", "picture's middle to its upper border"),
        Field("seed", "uint"),
        Field("red_of_xyz", "vec4", "row of the XYZ to linear Rec.709 matrix"),
        Field("green_of_xyz", "vec4"),
        Field("blue_of_xyz", "vec4"),
        Field("background", "vec4", "linear Rec.709 radiance where nothing is met"),
        Field("sky_x", "vec3", "column of the rotation from the world to the environment's frame"),
        Field("map_scale", "float", "factor on the caustic maps: one over the passes in them"),
        Field("sky_y", "vec3"),
        Field("sample_side", "float", "side of a sample's share of its pixel, pixels"),
        Field("sky_z", "vec3"),
        Field("pixel_width", "float", "of a pixel whose columns rays carry, in pixels of this picture"),
        Field("looks", "vec4", "places of a sample's lookups of what is seen directly, two each", 2),
        Field("size", "uvec2", "picture, pixels"),
        Field("within_pixel", "vec2", "this sample's place in its pixel, 0 to 1"),
        Field("inside_mask", "uint", "solids the camera is in, bits of the medium stack"),
        Field("inside_object", "uint", "solid outside the stack that it is in, or NONE"),
        Field("bands", "uint", "stretches the spectrum is cut into; a sample is of one of them"),
        Field("dithered", "uint", "whether pixels begin with different bands"),
        Field("max_taps", "uint", "lookups along one sweep at most"),
        Field("split_threshold", "float", "share of a path's power above which both of its parts are followed"),
        Field("counts_turns", "uint", "whether pixels count their own dispersed samples instead"),
        Field("taps_per_pixel", "float", "lookups along a sweep, for every pixel it is long"),
        Field("band_side", "float", "side of the share of its pixel that a sample of one band has, pixels"),
        Field("primary_samples", "uint", "lookups of one sample at what is seen directly"),
        Field("first_listed", "uint", "of the listed pixels, this dispatch's first"),
        Field("pixel_height", "float", "as pixel_width"),
        Field("end_listed", "uint", "… and the one after its last"),
        Field("first_place", "uint", "where the first of them waits; NONE where this dispatch takes up halted ones"),
        Field("queue", "uint", "of the two, the one that samples which halt are put on"),
        Field("survey", "uint", "0: none; 1: this sample is one of a survey; 2: even pixels keep what a survey found"),
        Field("survey_at", "uint", "where the survey's pixels begin, words of the list"),
        Field("survey_gain", "float", "share of a survey that one of its samples is"),
        Field("cells", "vec2", "columns and rows of a pixel's cells, one for each of a launch's looks; 0: none"),
        Field("lens_radius", "float", "GPU units"),
        Field("focus_distance", "float", "of the plane of focus, along `forward`, GPU units"),
        Field("unused", "vec2", ""),
    ),
)


def light_record(light: Light, scene: SceneBuffers) -> np.void:
    """The light in GPU space."""
    record = CAMERA_LIGHT.zeros(1)[0]
    tangent, bitangent, axis = light.axes().T
    record["position"] = scene.space.to_gpu(np.array(light.position))
    record["kind"] = light.gpu_code
    record["axis"] = axis
    record["is_disc"] = light.is_disc
    half = np.array(light.half_extent) * scene.space.scale
    if light.angular_radius > 0.0:
        half = np.full(2, np.tan(light.angular_radius))
        record["measure"] = 1.0 / (np.pi * np.sin(light.angular_radius) ** 2)
    elif light.has_extent:
        record["measure"] = light.area * scene.space.scale**2
    record["half_u"], record["half_v"] = tangent * half[0], bitangent * half[1]
    if light.profile is not None:
        record["has_profile"], record["profile"] = 1, scene.profile_start(light)
        record["half_u"], record["half_v"] = light.across
    record["cone"] = light.cone
    return record


def camera_parameters(scene: SceneBuffers, camera: Camera, width: int, height: int) -> np.ndarray:
    """CAMERA_PARAMETERS (1,) with what the camera and the scene round it decide; how its samples are spread is left."""
    space = scene.space
    right, up, forward = camera_frame(camera)
    orthographic = camera.kind == "orthographic"
    half_height = (
        0.5 * camera.vertical_extent * space.scale
        if orthographic
        else np.tan(np.radians(0.5 * camera.vertical_fov_deg))
    )
    parameters = CAMERA_PARAMETERS.zeros(1)
    parameters["position"] = space.to_gpu(np.array(camera.position))
    parameters["orthographic"] = orthographic
    parameters["forward"] = forward
    parameters["half_right"] = right * half_height * width / height
    parameters["half_up"] = up * half_height
    parameters["lens_radius"] = camera.lens_radius * space.scale
    parameters["focus_distance"] = camera.plane_of_focus * space.scale
    for name, row in zip(("red_of_xyz", "green_of_xyz", "blue_of_xyz"), xyz_to_rgb709_matrix(), strict=True):
        parameters[name][0, :3] = row
    parameters["size"] = width, height
    parameters["pixel_width"] = parameters["pixel_height"] = 1.0
    parameters["primary_samples"] = 1
    parameters["background"][0, :3] = scene.scene.background_rgb
    environment = scene.scene.environment
    if environment is not None:
        columns = np.asarray(environment.world_to_local, float).T
        for name, column in zip(("sky_x", "sky_y", "sky_z"), columns, strict=True):
            parameters[name] = column
    parameters["inside_mask"], parameters["inside_object"] = scene.media_at(np.array(camera.position))
    return parameters
