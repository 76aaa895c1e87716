"""When a live rendering does what: one immutable value, and what every event makes of it.

`step` is pure: it knows no device and reads no clock. The engine reports what happened and carries out the actions
that are returned, so that everything about dragging, stillness, retracing and waiting can be tested without OpenGL.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum, auto

from .dirty_level import DirtyLevel

STILL_S = 0.5
"""Without a change for so long, what was only approximated is done properly."""
CALM_S = 0.12
"""Without a change for so long, a coarse picture is replaced by a full one."""


@dataclass(frozen=True)
class CameraState:
    """How far the picture is, see `LiveCamera`."""

    is_coarse: bool = False
    owes_picture: bool = False
    is_within_cycle: bool = False
    is_done: bool = True
    is_full_size: bool = True
    """What is shown is no preview of a movement."""
    is_whole: bool = True
    """Every pixel that is shown has its own path."""
    owes_first: bool = False
    """Nothing of this scene is shown yet: the first picture of it is being made."""


class Action(Enum):
    """What the engine shall do."""

    BUILD = auto()
    """Begin to make programs, buffers and photons for what is wanted."""
    FOLLOW_PHOTONS = auto()
    """Show the stored photons as is wanted: as a preview at once, then all of them."""
    FOLLOW_CAMERA = auto()
    """Take over all that is wanted, which only the camera sees."""
    MOVE_CAMERA = auto()
    """Take over the view alone: the rest is being built."""
    REFIT_MAPS = auto()
    """Lay the maps out anew for what is wanted and fill them again."""
    FOLLOW_MOVE = auto()
    """Show the same things in their new places by a few photons; what was being built is not wanted any more."""
    JUDGE_MAPS = auto()
    """Refit where that would show more."""
    OFFER_MAPS = auto()
    """The maps that waited may be shown: report them again (`MapsReady`)."""
    REFINE_PICTURE = auto()
    """Replace the coarse picture of this view by a full one."""


@dataclass(frozen=True)
class ShowMaps:
    """Action: the maps as they are become what the camera sees."""

    same_view: bool
    """What is shown may stay until the new picture is as smooth."""
    finer_maps: bool
    """So much better that more bands of the spectrum may be distinguished in them."""


# ---- events ----------------------------------------------------------------------------------


class Happened(Enum):
    """Events of which nothing more is to be said."""

    WISHED = auto()
    """Something else is wanted."""
    RETRACE_ASKED = auto()
    """Photons shall be traced through the glass that is shown."""
    BUILD_ASKED = auto()
    """Everything shall be made anew, whatever runs."""
    FAILED = auto()
    """A build or an action failed; what was shown stays."""
    PREVIEW_SHOWN = auto()
    """The camera sees the maps of a preview."""
    SPLATTING_ENDED = auto()
    """The stored photons are in the maps again."""
    TRACING_BEGAN = auto()
    """There are photons to trace."""
    TRACING_ENDED = auto()
    """The target is reached."""


@dataclass(frozen=True)
class FrameBegan:
    """The engine may work for a frame. `interacting`: something is being dragged."""

    interacting: bool


@dataclass(frozen=True)
class Examined:
    """The engine has compared what is wanted with what is shown."""

    camera: CameraState = CameraState()
    level: DirtyLevel = DirtyLevel.NOTHING
    """What has to be redone for it."""
    moves_view: bool = False
    """Camera or picture size are others."""
    moves_things: bool = False
    """Only the places of things differ from what photons were traced for."""


@dataclass(frozen=True)
class Built:
    """What was built is shown. `coarse_maps`: in those of a first preview."""

    coarse_maps: bool = True


@dataclass(frozen=True)
class SplattingBegan:
    """The stored photons are being splatted again, then tracing continues. `first_order`: they follow an edit to first
    order only; `refitted`: into new maps."""

    first_order: bool
    refitted: bool = False


@dataclass(frozen=True)
class MapsReady:
    """The maps are worth showing. `passes`: complete ones of this size that they hold; `is_other`: the light of another
    scene than the picture shows."""

    passes: int
    camera: CameraState = CameraState()
    is_other: bool = False


@dataclass(frozen=True)
class CameraWorked:
    """The camera pass had its share of the frame."""

    camera: CameraState = CameraState()


Event = Happened | FrameBegan | Examined | Built | SplattingBegan | MapsReady | CameraWorked
Next = tuple["Schedule", tuple[Action | ShowMaps, ...]]


# ---- the state -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Schedule:
    """What is under way and what is due."""

    changed_at: float = 0.0
    """When something else was wanted last, or a drag ended."""
    interacting: bool = False
    wish_is_due: bool = False
    """What is wanted has not been examined."""
    retrace_is_due: bool = False
    shows_scene: bool = False
    """There are photons of some scene; not before the first build."""
    building: bool = False
    wish_is_newer: bool = False
    """Something else is wanted than what is being built."""
    failed: bool = False
    """The last build or action; nothing is tried again by itself."""
    splatting: bool = False
    """Stored photons are due in the maps again, before tracing."""
    tracing: bool = False
    playing: bool = True
    """Photons accumulate."""
    refines_when_still: bool = True
    """Trace again with the new glass once nothing changes, where the picture followed an edit to first order only."""
    first_order: bool = False
    maps_are_coarse: bool = True
    """They are those of a first preview."""
    shows_preview: bool = False
    moved: bool = False
    """A few photons show things where a drag has moved them: what was traced before is of no use any more."""
    maps_wait: bool = False
    """Better maps are there, but the camera is within a cycle of bands."""

    @property
    def has_photon_work(self) -> bool:
        """Something is to be splatted or traced."""
        return self.splatting or (self.tracing and self.playing)

    @property
    def last_maps_wait(self) -> bool:
        """Maps wait that no further photons will replace."""
        return self.maps_wait and not (self.tracing or self.splatting or self.shows_preview)

    @property
    def will_retrace(self) -> bool:
        """Once nothing changes."""
        return self.shows_scene and self.refines_when_still and self.first_order and not self.failed

    def yields_to_camera(self, camera: CameraState) -> bool:
        """A drag gets the whole budget: what its next step discards is not begun. So does the first picture of a
        scene: better maps that come before it would begin it again and again."""
        return camera.owes_first or (self.interacting and (camera.owes_picture or self.shows_preview))

    def finishes_preview(self, camera: CameraState) -> bool:
        """Where not even the smallest picture fits a frame, one that has begun is finished first: else nothing would be
        seen to move."""
        return self.interacting and camera.is_coarse and camera.owes_picture

    def is_idle(self, camera: CameraState) -> bool:
        """Nothing is left to do until something else is wanted."""
        waits = self.building or self.wish_is_due or self.has_photon_work or self.last_maps_wait
        return not (waits or self.will_retrace or not camera.is_done)

    def is_still(self, now: float) -> bool:
        """Nothing has changed for a while."""
        return not self.interacting and now - self.changed_at > STILL_S


def step(schedule: Schedule, event: Event, now: float) -> Next:
    """What `event` at `now` (s) makes of `schedule`, and what is to be done, in order."""
    s = schedule
    match event:
        case Happened.WISHED:
            return replace(s, changed_at=now, wish_is_due=True, wish_is_newer=s.building), ()
        case Happened.RETRACE_ASKED:
            return replace(s, retrace_is_due=s.shows_scene and s.first_order), ()
        case Happened.BUILD_ASKED:
            return _build(s)
        case FrameBegan(interacting):
            if s.interacting and not interacting:
                s = replace(s, changed_at=now, wish_is_due=True)
            return replace(s, interacting=interacting), ()
        case Examined():
            return _examine(s, event, now)
        case Built(coarse_maps):
            return replace(_built(s), maps_are_coarse=coarse_maps), ()
        case Happened.FAILED:
            return replace(s, building=False, wish_is_newer=False, failed=True), ()
        case Happened.PREVIEW_SHOWN:
            return replace(s, shows_preview=True), ()
        case SplattingBegan(first_order, refitted):
            coarse = s.maps_are_coarse and not refitted
            return replace(s, splatting=True, tracing=True, first_order=first_order, maps_are_coarse=coarse), ()
        case Happened.SPLATTING_ENDED:
            return replace(s, splatting=False), ()
        case Happened.TRACING_BEGAN:
            return replace(s, tracing=True), ()
        case Happened.TRACING_ENDED:
            return replace(s, tracing=False), ()
        case MapsReady():
            return _maps_ready(s, event)
        case CameraWorked(camera):
            return s, _after_camera(s, camera, now)


def _examine(s: Schedule, event: Examined, now: float) -> Next:
    if not s.shows_scene:
        starts = not s.building and (s.wish_is_due or not s.failed)
        s = replace(s, wish_is_due=False)
        return _build(s) if starts else (s, ())
    if s.retrace_is_due or (s.is_still(now) and s.will_retrace):
        s = replace(s, retrace_is_due=False)
        return (s, ()) if s.building else _build(s)
    if s.wish_is_due:
        return (s, ()) if s.finishes_preview(event.camera) else _fulfil(replace(s, wish_is_due=False), event)
    if s.building or s.moved or event.camera.owes_first:
        return s, ()
    if s.maps_are_coarse and not s.interacting:
        return s, (Action.REFIT_MAPS,)
    # Other maps take their time to fill: the picture by these is made whole first.
    return s, (Action.JUDGE_MAPS,) if s.is_still(now) and event.camera.is_whole else ()


def _fulfil(s: Schedule, event: Examined) -> Next:
    """The least that shows what is wanted."""
    if s.interacting and event.moves_things and event.level >= DirtyLevel.TRACE:
        moved = replace(s, building=False, failed=False, splatting=False, tracing=False, first_order=False)
        return replace(moved, moved=True, maps_wait=False), (Action.FOLLOW_MOVE,)
    if event.level >= DirtyLevel.TRACE:
        # A build that runs is finished first and shown; then the newest wish is examined.
        s, actions = (replace(s, wish_is_due=s.wish_is_newer), ()) if s.building else _build(s)
        return s, (*actions, Action.MOVE_CAMERA) if event.moves_view else actions
    if event.level == DirtyLevel.SPLAT:  # which nobody builds for any more
        return replace(s, building=False, wish_is_newer=False), (Action.FOLLOW_PHOTONS,)
    if event.level == DirtyLevel.CAMERA:
        return s, (Action.MOVE_CAMERA if s.building else Action.FOLLOW_CAMERA,)
    return s, ()


def _build(s: Schedule) -> Next:
    return replace(s, building=True, wish_is_newer=False, failed=False), (Action.BUILD,)


def _built(s: Schedule) -> Schedule:
    # What was wished for meanwhile is examined in the next frame.
    return replace(
        s,
        shows_scene=True,
        building=False,
        wish_is_due=s.wish_is_newer,
        wish_is_newer=False,
        splatting=False,
        tracing=True,
        first_order=False,
        moved=False,
        maps_wait=False,
    )


def _maps_ready(s: Schedule, event: MapsReady) -> Next:
    """More photons of the same kind wait until the camera has seen every band of the spectrum, finer ones until all
    pixels of glass are seen."""
    anew = s.shows_preview or s.splatting or event.is_other
    waits = event.passes > 1 or not event.camera.is_whole
    if waits and not anew and not s.interacting and event.camera.is_within_cycle:
        return replace(s, maps_wait=True), ()
    same_view = not s.interacting and event.camera.is_full_size
    return replace(s, maps_wait=False, shows_preview=False), (ShowMaps(same_view, event.passes <= 1 or anew),)


def _after_camera(s: Schedule, camera: CameraState, now: float) -> tuple[Action, ...]:
    if s.last_maps_wait and not camera.is_within_cycle:
        return (Action.OFFER_MAPS,)
    calm = not s.interacting and now - s.changed_at > CALM_S
    return (Action.REFINE_PICTURE,) if calm and camera.is_coarse and not camera.owes_picture else ()
