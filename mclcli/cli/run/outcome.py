"""What a run came to, once it is over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from mclcli.errors import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.cli.run.outputs import Outputs
    from mclcli.cli.run.references import Findings
    from mclcli.io.recording.recording import Recording
    from mclcli.replay.loop import ReplayTally, Setup
    from mclcli.settings.profiles import Settings
    from mclcli.world.occupancy import OccupancyGrid


@final
@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """A run that is over: the log, how it was run, what became of its messages, and what was written.

    ``compare`` holds it against its references, once; ``seconds`` is how long it took.
    """

    recording: Recording
    setup: Setup
    settings: Settings
    grid: OccupancyGrid | None
    tally: ReplayTally
    outputs: Outputs
    compare: Callable[[], Findings]
    seconds: float

    @property
    def findings(self) -> Findings:
        """The run against its references; InputError where one of them states nothing at the time of the run."""
        return self.compare()

    @property
    def code(self) -> ExitCode:
        """How the command ends."""
        return ExitCode.DAMAGED if self.recording.tally.lossy else ExitCode.COMPLETE
