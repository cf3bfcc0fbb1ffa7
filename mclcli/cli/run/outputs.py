"""What ``mcl run`` writes while it goes: traces, tracks, steps; and the track it keeps for picture and summary."""

from __future__ import annotations

import hashlib
import re
import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, final

from mclcli.cli import console
from mclcli.cli.run.ends import Ends
from mclcli.errors import UsageError
from mclcli.geometry.trajectory import Track
from mclcli.io.traces.formats import OUTPUTS, About, format_of
from mclcli.io.traces.output import Output, open_output
from mclcli.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType
    from typing import Self

    from mclcli.cli.run.options import RunOptions
    from mclcli.cli.run.preparing import Prepared
    from mclcli.io.traces.formats import Format, Role, Writer
    from mclcli.records import StepRecord, TrackPoint, Transform
    from mclcli.settings.profiles import Settings

    Target = tuple[Role, str]

# Options that change how mcl works or where it writes, not what comes out.
_UNRECORDED = {"-o", "--output", "--track", "--steps", "--picture", "--threads", "--cache-dir", "--color"}
_UNRECORDED_FLAGS = re.compile(r"-[vq]+|--verbose|--quiet|--debug|--json|-o.+")


@final
class Outputs:
    """All outputs of one run, opened together and finished together; ``caveat`` goes where it will be read."""

    def __init__(
        self,
        options: RunOptions,
        ready: Prepared,
        targets: Sequence[Target],
        inputs: Sequence[Path],
        *,
        caveat: str = "",
    ) -> None:
        recording, setup, settings = ready.recording, ready.setup, ready.settings
        # Kept where something is made of it at the end: a log may be longer than memory.
        self.track = Track(whole=bool(options.picture or options.truth or options.versus))
        self.last_step: StepRecord | None = None
        self.ends = Ends()
        self._targets = targets
        self._inputs = inputs
        self._about = About(
            metadata={**_metadata(options, ready), **({"caveat": caveat} if caveat else {})},
            parameters_yaml=partial(_parameters_yaml, settings),
            sensors=[instrument.name for instrument in setup.instruments.values()],
            grid=ready.grid,
            odom_frame=setup.odom_frame,
            base_frame=setup.base_frame,
            map_frame=settings.frames.global_frame_id,
            static_transforms=recording.survey.statics(ready.parts.transform_topics),
            backend=setup.localizer.backend,
            caveat=caveat,
        )
        self._stack = ExitStack()
        self._opened: list[Output] = []
        self._writers: list[Writer] = []
        self._waiting: list[tuple[Format, Output]] = []  # tables that no line was written to
        self._whole: list[Output] = []

    @property
    def keeps(self) -> bool:
        """Whether anything is written."""
        return bool(self._targets)

    @property
    def keeps_transforms(self) -> bool:
        """Whether a trace passes the recorded transforms on."""
        return any(writer.transforms is not None for writer in self._writers)

    def __enter__(self) -> Self:
        try:
            for role, target in self._targets:
                self._open(role, target)
        except BaseException:
            self._stack.__exit__(*sys.exc_info())
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._begin()
            for writer in self._writers:
                writer.close()
            for output in self._whole:
                output.allow_part()
        except BaseException:
            self._stack.__exit__(*sys.exc_info())
            raise
        self._stack.__exit__(kind, error, trace)
        for output in self._opened if kind is not None else ():
            console.tell_kept(output.kept)

    def write(self, point: TrackPoint) -> None:
        """Write one point everywhere it belongs."""
        if self._waiting:
            self._begin()
        self.track.append(point)
        self.ends.take(point)
        if point.step is not None:
            self.last_step = point.step
        for writer in self._writers:
            writer.write(point)

    def pass_on(self, transforms: tuple[Transform, ...]) -> None:
        """Copy one recorded message of transforms into the traces that keep them."""
        moving = [transform for transform in transforms if not transform.static]
        for writer in self._writers if moving else ():
            if writer.transforms is not None:
                writer.transforms(moving[0].stamp_ns, moving)

    def _open(self, role: Role, target: str) -> None:
        form = format_of(role, target)
        output = open_output(target, binary=form.binary, inputs=self._inputs)
        self._stack.push(output)  # before its file is there: an interrupt in between must find it
        self._stack.enter_context(output)
        self._opened.append(output)
        if form.binary:  # some pass transforms on, which come before any row
            self._writers.append(form.make(output, self._about))
        else:
            self._waiting.append((form, output))
        if form.stays_whole:
            self._whole.append(output)

    def _begin(self) -> None:
        """Begin what was opened: tables with their first row, so that nothing is on stdout of a run that is refused."""
        self._writers += [form.make(output, self._about) for form, output in self._waiting]
        self._waiting.clear()


def _parameters_yaml(settings: Settings) -> str:
    from mclcli.io.tables.params_yaml import format_params

    return format_params(settings.as_file())


def targets_of(options: RunOptions) -> list[Target]:
    """Role and name of every output of a run; the track on stdout if none is named and stdout is not a terminal."""
    targets: list[Target] = [("trace", name) for name in options.traces]
    targets += [("track", name) for name in options.tracks]
    if options.steps:
        targets.append(("steps", options.steps))
    wanted = options.picture or options.as_json or options.seeds is not None
    return checked(targets, () if wanted else [("track", "-")])


def checked(targets: Sequence[Target], instead: Sequence[Target]) -> list[Target]:
    """The outputs if each can be one; where there is none and stdout is no terminal, those ``instead``.

    Raises
    ------
    UsageError
        If an ending has no format, or a name is there twice.

    """
    for role, name in targets:
        _check_suffix(role, name)
    names = [name for _, name in targets]
    if names.count("-") > 1:
        raise UsageError("only one output can go to stdout; give the others a name")
    for name in names:
        if name != "-" and names.count(name) > 1:
            raise UsageError(f"{name}: named for two outputs; give each its own name")
    return [*targets] or ([] if sys.stdout.isatty() else [*instead])


def _check_suffix(role: Role, name: str) -> None:
    allowed = tuple(OUTPUTS[role])
    special = name == "-" or name.startswith(("/dev/", "/proc/"))
    if not special and not name.endswith(allowed):
        option = {"trace": "-o", "track": "--track", "steps": "--steps", "smoothed": "-o"}[role]
        raise UsageError(f"{option} {name}: the name must end in {' or '.join(allowed)}, or be -")


def _metadata(options: RunOptions, ready: Prepared) -> dict[str, object]:
    """What it takes to make the same trace again; no clock, no folders."""
    recording, setup, settings = ready.recording, ready.setup, ready.settings
    grid, landmarks = ready.grid, ready.landmarks
    metadata: dict[str, object] = {
        "version": __version__,
        "profile": settings.profile,
        "model": settings.model,
        "seed": setup.localizer.seed,
        "temperature": {i.name: i.alpha for i in setup.instruments.values()},
        "parameters": settings.values(),
        "topics": {i.name: topic for topic, i in setup.instruments.items()},
        "odometry": setup.odometry,
        "logs": [Path(name).name for name in options.logs],
        "log_sha256": recording.log.digest(),
        "argv": recorded_argv(sys.argv[1:], setup.localizer.seed),
    }
    if grid is not None:
        metadata["map"] = Path(options.map_file).name if options.map_file else "from the log"
        metadata["map_sha256"] = grid.digest()
    if landmarks is not None:
        metadata["landmarks_sha256"] = hashlib.sha256(
            repr((landmarks.ids, landmarks.positions.tolist())).encode()
        ).hexdigest()
    return metadata


def recorded_argv(argv: Sequence[str], seed: int = 0) -> list[str]:
    """Arguments that decide what comes out, files by their base names; of several seeds, the one that was used."""
    kept: list[str] = []
    rest = iter(argv)
    for word in rest:
        if word in _UNRECORDED:
            next(rest, None)
        elif word == "--seeds" or word.startswith("--seeds="):
            if word == "--seeds":
                next(rest, None)
            kept += ["--seed", str(seed)]
        elif word.partition("=")[0] not in _UNRECORDED and not _UNRECORDED_FLAGS.fullmatch(word):
            kept.append(_base_name(word))
    return kept


def _base_name(word: str) -> str:
    """A path's last part; topics and everything else stay as they are."""
    option, equals, value = word.partition("=")
    if equals and option.startswith("--"):
        return f"{option}={_base_name(value)}"
    return Path(word).name if "/" in word and Path(word).exists() else word
