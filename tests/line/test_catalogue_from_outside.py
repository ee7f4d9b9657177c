"""Added skills and an estimator, each one file and one entry, run from terminal and PLC."""

import json
import os
import shutil
import subprocess
from contextlib import ExitStack, closing

import pytest

from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import STAGES, Result
from skills.catalogue import CATALOGUE
from tests.line.forked import forked
from tests.pages import ROOT, blocks
from tests.serving import process

PACKAGES = ("cell", "config", "drivers", "plc_bridge", "sim", "skills")
EXTEND = {block.info: block.text for block in blocks() if block.page == ROOT / "docs" / "extend.md"}
CODE, STAGE = max(CATALOGUE.by_code) + 2, max(CATALOGUE.stages) + 2
OWN = max(99, *CATALOGUE.reasons) + 1
"""Numbers that are free in the catalogue with the skill of that page, which has the next ones."""
PATIENCE = 60.0

SKILL = f'''"""Hold still for a while and compare the in-hand angle with a parameter."""

from dataclasses import dataclass
from enum import IntEnum

from drivers.quantities import ImpedanceSetpoint
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import VALIDITY, Gains


class Unexpected(IntEnum):
    OTHER_ANGLE = {OWN}


class LookParams(SkillParams):
    seconds: float = 0.5
    theta: float = 0.25
    gains: Gains = Gains(translation=500.0, rotation=20.0)


@dataclass(frozen=True, slots=True)
class LookResult(SkillResult):
    theta: float


def run(params: LookParams, ctx: SkillContext) -> LookResult:
    tcp, identity, theta = ctx.observe().arm.tcp, ctx.new_id(), 0.0
    for seen in ctx.scan(params.seconds):
        theta = seen.peg.theta
        ctx.follow(
            ImpedanceSetpoint(
                id=identity, tip=tcp.position, axis=-tcp.rotation[:, 0], roll=tcp.rotation[:, 2],
                stiffness=params.gains.stiffness(), damping_ratio=params.gains.damping_ratios(), valid_until=seen.stamp + VALIDITY,
            )
        )
    if abs(theta - params.theta) > 1e-6:
        return LookResult(Outcome.FAILURE, Unexpected.OTHER_ANGLE, params.seconds, theta)
    return LookResult(Outcome.SUCCESS, Reason.NONE, params.seconds, theta)
'''
SKILL_ENTRY = """    Skill(
        name="look", code={code}, stage={stage}, section="look", params=look.LookParams, perform=look.run,
        steered=("gains",), counts=True, reasons=look.Unexpected,
    ),
"""
ESTIMATOR = '''"""Estimates the configured angle from every frame."""

from drivers.config_model import ConfigModel
from drivers.quantities import TaxelFrame
from skills.tactile.pose import PegPose


class FixedParams(ConfigModel):
    theta: float = 0.25


class FixedEstimator:
    def __init__(self, params: FixedParams) -> None:
        self._params = params

    def estimate(self, frame: TaxelFrame) -> PegPose:
        return PegPose(self._params.theta, 0.0, 0.01, 0.0, True, frame.stamp)
'''
ESTIMATOR_ENTRY = """    EstimatorEntry("{name}", fixed.FixedParams, lambda params, setup: fixed.FixedEstimator(params)),
"""


def put(file, before, text):
    """Put a text behind the only `before` in the file."""
    content = file.read_text(encoding="utf-8")
    assert content.count(before) == 1
    file.write_text(content.replace(before, before + text), encoding="utf-8")


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    """Return a copy of the program with these additions, its map with room for one more stage."""
    folder = tmp_path_factory.mktemp("house")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package)
    table = folder / "plc_bridge" / "protocol" / "messages.py"
    put(table, f"\nSTAGES = {STAGES}\n", f"STAGES = {max(STAGE, STAGES)}\n")
    (folder / "skills" / "look.py").write_text(SKILL, encoding="utf-8")
    (folder / "skills" / "lift.py").write_text(EXTEND["python skills/lift.py"], encoding="utf-8")
    catalogue = folder / "skills" / "catalogue.py"
    put(catalogue, "\nfrom skills import ", "lift, look, ")
    put(catalogue, "\nCATALOGUE = Catalogue(\n", "    LIFT,\n" + SKILL_ENTRY.format(code=CODE, stage=STAGE))
    put(catalogue, "\n    claim=Claim.FREED,\n)\n", EXTEND["python skills/catalogue.py"])
    table = folder / "skills" / "tactile" / "estimators.py"
    (folder / "skills" / "tactile" / "fixed.py").write_text(ESTIMATOR, encoding="utf-8")
    put(table, "\nfrom drivers.skin.layout import Layout\n", "from skills.tactile import fixed\n")
    put(table, "\nESTIMATORS = estimators(\n", ESTIMATOR_ENTRY.format(name="fixed"))
    (folder / "config" / "recipes" / "2.toml").write_text("[look]\ntheta = 0.5\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def call(house, tmp_path_factory):
    """Yield a function that runs the program of `house`."""
    with forked(tmp_path_factory.mktemp("bin"), house) as command:
        yield lambda *words: subprocess.run([command, *words], capture_output=True, text=True, check=False)


def test_the_skill_of_the_page_runs_after_the_edits_that_it_names(call, tmp_path):
    (command,) = EXTEND["console after-the-edit"].splitlines()
    done = call(*command.split()[1:], "--json", "--journal", str(tmp_path))
    assert (done.returncode, json.loads(done.stdout)["stage"]) == (0, "lift"), done.stderr


def test_the_terminal_runs_skill_and_estimator(call, tmp_path):
    kept = ("--json", "--journal", str(tmp_path))
    words = ("run", "look", *kept, "--set", "sim.pace=max", "--set", "insert.estimator=fixed")
    good = call(*words, "--set", "fixed.theta=0.1", "--set", "look.theta=0.1")
    row = json.loads(good.stdout)
    assert (good.returncode, row["outcome"], row["stage"]) == (0, "success", "look")
    assert row["stage_times"] == [["look", pytest.approx(0.5)]]
    (stage,) = json.loads(call("show", str(row["run"]), *kept).stdout)["stages"]
    assert stage["facts"] == {"theta": pytest.approx(0.1)}
    bad = call(*words, "--set", "fixed.theta=0.2")
    row = json.loads(bad.stdout)
    assert (bad.returncode, row["outcome"], row["reason"]) == (1, "failure", "other_angle")


def test_a_plc_runs_them_and_reads_their_time(house, tmp_path):
    """The default recipe expects the estimator's angle, and recipe 2 does not."""
    sets = [f"plc.life_timeout={PATIENCE}", "insert.estimator=fixed", "sim.pace=max"]
    where = {"cwd": house, "env": {**os.environ, "PYTHONPATH": str(house)}}
    with process(tmp_path, sets, **where) as (_, (address,)), closing(Peer(*address, timeout=PATIENCE)) as peer:
        peer.connect()
        seen, unseen = (peer.run(CODE, recipe=recipe, timeout=PATIENCE) for recipe in (0, 2))
    assert (seen.result, seen.stage, seen.reason) == (Result.SUCCESS, STAGE, 0)
    assert (unseen.result, unseen.stage, unseen.reason) == (Result.FAILURE, STAGE, OWN)
    assert (seen.total_time, unseen.total_time) == pytest.approx((0.5, 0.5))


def test_the_map_names_their_numbers(call):
    words = json.loads(call("map", "--format", "json").stdout)
    meanings = {entry["name"]: entry["meaning"] for entry in words}
    assert f"{CODE} look" in meanings["command_code"]
    assert f"{STAGE} look" in meanings["report_stage"]
    assert f"{OWN} OTHER_ANGLE" in meanings["report_reason"]


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("look.gains={translation=500.0, rotation=4000.0}", ("look.gains.rotation = 4000", "unstable")),
        ("look.seconds=long", ("look.seconds = 'long'", "a number")),
        ("insert.estimator=eye", ("insert.estimator = 'eye'", '"fixed", "image", "robust" allowed')),
    ],
)
def test_a_wrong_value_of_them_is_refused_as_any_other(call, key, words):
    wrong = call("run", "look", "--set", key)
    assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)
    assert all(word in wrong.stderr for word in words), wrong.stderr


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"code": 9}, ("look: command code 9", "100 to 65535")),
        ({"stage": 99}, ("look: stage 99", "the PLC's map holds")),
        ({"name": "robust"}, ("estimators: robust", "two")),
        ({"name": "search"}, ("[search]", "a skill and an estimator")),
        ({"name": "limits"}, ("[limits]", "a key of every cell")),
    ],
)
def test_a_clash_ends_every_command_with_one_line(house, call, changes, words):
    numbers = {"code": CODE, "stage": STAGE, "name": "fixed"}
    with ExitStack() as before:
        for path, entry in (("skills/catalogue.py", SKILL_ENTRY), ("skills/tactile/estimators.py", ESTIMATOR_ENTRY)):
            text = (house / path).read_text(encoding="utf-8")
            before.callback((house / path).write_text, text, encoding="utf-8")
            other = text.replace(entry.format(**numbers), entry.format(**{**numbers, **changes}))
            (house / path).write_text(other, encoding="utf-8")
        clash = call("run", "recover")
    assert (clash.returncode, clash.stdout, clash.stderr.count("\n")) == (2, "", 1)
    assert all(word in clash.stderr for word in words), clash.stderr
