"""Learning from part to part: the place of each recipe's hole, kept in one file over restarts."""

import hashlib
import json
import logging
from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from threading import Thread
from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, ValidationError

from cell.records import wall_clock
from cell.records.kept_file import OWNER_ONLY, KeptFile
from drivers.config_model import ConfigModel
from drivers.errors import ConfigError
from drivers.figures_file import replace_text
from drivers.parts import Coordinate, Job
from skills.flow import StageRecord
from skills.search.prior import NEEDED, LearningConfig, PlaceEstimate, first_estimate, from_prior
from skills.search.spray_search import SpraySearchResult

logger = logging.getLogger(__name__)

FILE = "learned.json"
"""Name of the file, beside the records of runs."""
Variance = Annotated[float, Field(gt=0.0, le=0.01)]
Place = tuple[Coordinate, Coordinate]


class LearnedPlace(ConfigModel):
    """Learnt place of one recipe's hole, as the file holds it."""

    job: str
    """Digest of the part and its place during learning."""
    mean: Place
    """Place of the fixture, m, base frame."""
    variance: tuple[Variance, Variance]
    """Variance of the fixture's place along x and y, m²."""
    scatter: tuple[Variance, Variance]
    """Variance of a part's hole about the fixture along x and y, m²."""
    parts: Annotated[int, Field(ge=1)]
    """Number of parts used for learning."""
    stray: Place | None
    """Place of the newest part's hole if it was not near the learnt place, m, base frame."""
    updated: AwareDatetime
    """Wall time of the newest part."""

    def doubt(self) -> str:
        """Return the reason why a valid place is not searched first; empty if it is searched first."""
        if self.stray is not None:
            return "in doubt: the last part was elsewhere"
        return "" if self.parts >= NEEDED else "too few parts yet"

    def estimate(self) -> PlaceEstimate:
        """Return the place as an estimate."""
        return PlaceEstimate(self.mean, self.variance, self.scatter, self.parts, self.stray)


class LearnedFile(ConfigModel):
    """Content of the file."""

    version: Literal[1] = 1
    """Version of the file's layout."""
    places: dict[Annotated[str, Field(pattern=r"^\d{1,5}$")], LearnedPlace] = Field(default_factory=dict)
    """Learnt place by number of the recipe."""

    def without(self, recipe: int) -> Self:
        """Return the content without the place of a recipe."""
        kept = {number: place for number, place in self.places.items() if int(number) != recipe}
        return self.model_copy(update={"places": kept})

    def text(self) -> str:
        """Return the file as text."""
        return self.model_dump_json(indent=2) + "\n"


def read_learned(folder: Path) -> LearnedFile:
    """Return the content of the file in a folder; empty without a file.

    Raises:
        ConfigError: The file cannot be read, or holds impossible values; one line.
    """
    path = folder / FILE
    try:
        return LearnedFile.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return LearnedFile()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = f"{'.'.join(map(str, first['loc']))}: " if first["loc"] else ""
        raise ConfigError(f"{path}: {where}{first['msg']}; `cell learned forget` deletes the file") from None


def forget(folder: Path, recipe: int | None = None) -> list[int]:
    """Forget one recipe, or delete the whole file; return the numbers of the forgotten recipes.

    Raises:
        ConfigError: The file cannot be written; or, for a single recipe, it cannot be read.
    """
    path = folder / FILE
    if recipe is None:
        known = _tried(folder)
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise ConfigError(f"{path}: cannot be removed: {error.strerror}") from None
        return [int(number) for number in known.places] if isinstance(known, LearnedFile) else []
    learned = read_learned(folder)
    kept = learned.without(recipe)
    if kept == learned:
        return []
    try:
        replace_text(path, kept.text(), mode=OWNER_ONLY)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}") from None
    return [recipe]


class Learning:
    """Gives each run the learnt place of its recipe, and learns from its result.

    The file is read before every run, so that a technician can delete places between runs. Other threads read and
    write it, because the disk must not delay the scan.
    """

    def __init__(
        self, folder: Path, learning: LearningConfig, now: Callable[[], datetime] = lambda: wall_clock.now()
    ) -> None:
        """Keep folder, settings and the function that returns the time; read the file."""
        self._folder, self._learning, self._now = folder, learning, now
        known = _tried(folder)  # if the file cannot be used, the first run that needs it logs this
        self._newest = known if isinstance(known, LearnedFile) else LearnedFile()
        self._kept = KeptFile(folder / FILE, "what was learnt")
        self._reader: Thread | None = None

    def flush(self) -> bool:
        """Wait up to a second until the learnt places are on the disk; return True if they are."""
        return self._kept.flush(1.0)

    def _known(self) -> LearnedFile | None:
        """Return the content of the file, read by a separate thread; None if it cannot be used, which is logged.

        If the newest content is not yet written, or the disk times out, return the last known content.
        """
        # Longest wait for the file to be read at the start or end of a run, s; the arm is at rest then.
        longest_read = 0.2
        if not self._kept.flush(0.0):
            return self._newest
        answers: list[LearnedFile | ConfigError] = []
        if self._reader is None or not self._reader.is_alive():  # else the last read has not finished yet
            self._reader = Thread(target=lambda: answers.append(_tried(self._folder)), name="learned", daemon=True)
            self._reader.start()
            self._reader.join(longest_read)
        if not answers:
            logger.warning(
                "%s: no answer within %g s: the last known content is used", self._folder / FILE, longest_read
            )
            return self._newest
        if isinstance(answers[0], ConfigError):
            logger.warning("%s", answers[0])
            return None
        self._newest = answers[0]
        return self._newest

    def prepared(self, job: Job, recipe: int) -> Job:
        """Return the job with the learnt place of its hole as prior; without a usable one, with the configured prior."""
        if not self._learning.place:
            return job
        estimate = self._estimate(self._known(), job, recipe)
        if estimate is None:
            return job
        hole = job.hole.model_copy(update={"prior": estimate.prior(self._learning)})
        return job.model_copy(update={"hole": hole})

    def take(self, job: Job, recipe: int, records: Sequence[StageRecord]) -> None:
        """Learn from a run that seated the peg. If the file cannot be written, this is logged and runs continue.

        Args:
            job: The job from the config, without a learnt prior.
            recipe: Number of the recipe.
            records: Stages of the run.
        """
        searches = _searches(records)
        hole = searches[-1].seated if searches else None
        if not self._learning.place or hole is None or (learned := self._known()) is None:
            return
        known = self._estimate(learned, job, recipe)
        estimate = first_estimate(hole, self._learning) if known is None else known.after(hole, self._learning)
        if estimate.stray is not None:
            logger.warning(
                "recipe %d: hole at %s, away from the place learnt from %d parts: the next search covers the whole area",
                recipe,
                hole,
                estimate.parts,
            )
        place = LearnedPlace(job=digest(job), **asdict(estimate), updated=self._now())
        self._newest = learned.model_copy(update={"places": {**learned.places, str(recipe): place}})
        self._kept.put(self._newest.text())

    def forget(self, recipe: int) -> None:
        """Forget a recipe at once, and queue the file for writing; if the file cannot be read, forget all recipes."""
        self._newest = (self._known() or LearnedFile()).without(recipe)
        self._kept.put(self._newest.text())

    def _estimate(self, learned: LearnedFile | None, job: Job, recipe: int) -> PlaceEstimate | None:
        """Return the learnt place of the hole if it is usable, else the configured prior; None if both are missing."""
        configured = from_prior(job.hole.prior, self._learning) if job.hole.prior is not None else None
        place = learned.places.get(str(recipe)) if learned is not None else None
        if place is None:
            return configured
        if (why := unusable(place, job, self._learning, self._now())) is not None:
            logger.warning("%s: recipe %d: %s: not used", self._folder / FILE, recipe, why)
            return configured
        return place.estimate()


def _tried(folder: Path) -> LearnedFile | ConfigError:
    """Return the content of the file in a folder, or the error why it cannot be used."""
    try:
        return read_learned(folder)
    except ConfigError as error:
        return error


def unusable(place: LearnedPlace, job: Job, learning: LearningConfig, now: datetime) -> str | None:
    """Return the reason why a learnt place must not be used for a job; None if it can."""
    if place.job != digest(job):
        return "learnt with another part or place"
    age = (now - place.updated).total_seconds()
    if age > learning.longest_age:
        return f"learnt {age / 86400:.0f} days ago; at most {learning.longest_age / 86400:g} allowed"
    sides = list(zip(job.hole.centre[:2], job.hole.area, strict=True))
    low, high = [centre - extent / 2 for centre, extent in sides], [centre + extent / 2 for centre, extent in sides]
    if not all(a <= m <= b for a, m, b in zip(low, place.mean, high, strict=True)):
        return f"place {list(place.mean)}: outside the area of the hole; {low} to {high} allowed"
    return None


def digest(job: Job) -> str:
    """Return a short digest of part and place; a learnt place is valid only for the same digest."""
    text = json.dumps([job.peg.model_dump(), job.hole.model_dump(exclude={"prior"})], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def hole_found(records: Sequence[StageRecord]) -> Place | None:
    """Return the hole found by a run, m, base frame: from the seated peg, else from the last edge contact; None without one."""
    return next(
        (search.seated or search.edge for search in reversed(_searches(records)) if search.edge is not None), None
    )


def _searches(records: Sequence[StageRecord]) -> list[SpraySearchResult]:
    return [record.result for record in records if isinstance(record.result, SpraySearchResult)]
