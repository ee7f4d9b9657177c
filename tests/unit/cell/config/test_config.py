"""A config is read in layers; a wrong value is refused in one line."""

import re
import shutil

import pytest

from cell.config.checks import require_permitted
from cell.config.files import DEFAULT, SHIPPED, arm_file
from cell.config.load import load, with_parameters
from cell.config.margins import inertias
from cell.run.supervisor import is_timed
from drivers.errors import ConfigError
from drivers.part.round import Round
from skills.catalogue import SEARCH


def line_about(*sets, path=None):
    """Return the error message on a wrong config."""
    with pytest.raises(ConfigError) as caught:
        load(path, sets=sets)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def layer(folder, kind, name, text):
    """Write a preset or a recipe of a cell in a folder, and return the file."""
    file = folder / kind / f"{name}.toml"
    file.parent.mkdir(exist_ok=True)
    file.write_text(text)
    return file


NEARER = ["hole.centre=[0.40, 0.0, 0.1]"]
THIN = "peg.diameter=0.004; hole.diameter=0.0041"
LATCH = "hole.latch={kind='detent',force=%s,height=%s}"
PRIOR = "hole.prior={mean=%s,deviation=[0.001,0.001]}"
WIDE = "hole.area=[0.2,0.2]; limits.high=[0.55,0.45,0.80]"
"""Keys that the tables of wrong and of borderline values share."""


WRONG = [
    ("plc.can=3", ["--set", "plc.can = 3", "a section with interface (needed), channel (needed)"]),
    ("plc.rtu=true", ["--set", "plc.rtu = True", "a section with port (needed), unit"]),
    ("peg.diameter=8", ["--set", "peg.diameter = 8", "0.002 to 0.03", "8 mm is 0.008 m"]),
    ("hole.area=[60, 60]", ["hole.area", "0 to 0.2", "60 mm is 0.06 m"]),
    ("search.tilt=45", ["45: a number >= 0 and < 1.4 allowed; SI units: 45 degrees is 0.7854 rad"]),
    ("peg.diameter=0.0081", ["--set", "peg.diameter = 0.0081", "thicker than the hole", "0.0081"]),
    ("grasp.clearance=0.03", ["--set", "grasp.clearance = 0.03", "leaves the peg in its slot", "rack.depth = 0.03"]),
    ("search.descent=0.001", ["--set", "search.descent = 0.001", "too slow to reach the plate", "at least 0.0207"]),
    ("preset=hasty", ["preset", "'hasty'", "presets/"]),
    ("preset=[1]", ["preset = [1]: no such file in presets/"]),
    ("peg.shape=oval", ["peg.shape", "'oval'", '"square"']),
    ("hole.depth=0.06", ["hole.depth = 0.06", "peg.length"]),
    ("scan_rate=5", ["scan_rate = 5", "10 to 1000"]),
    ("contact.friction=[0.1, 3]", ["contact.friction", "[0.1, 3]", "0 to 2"]),
    ("arm.model=ur5", ["--set", 'arm.model = "ur5": no such arm; "fr3", "fr3v2", "panda" or a file']),
    ("arm.model=none.toml", ["arm.model", "none.toml", "no such arm"]),
    (f"arm.model={300 * 'x'}", ["arm.model", "xxx", "no such arm"]),
    ("sim.timestep=0.0007", ["sim", "0.0007", "does not divide"]),
    ("gibberish", ["gibberish", "KEY=VALUE"]),
    ("hole.centre=[1.2, 0.0, 0.1]", ["hole.centre = (1.2, 0.0, 0.1)", "Franka Emika Panda, does not reach it"]),
    ("limits.force=0.0", ["limits.force"]),
    ("peg.shape=square; corner.adjust.gains.rotation=400", ["corner.adjust.gains.rotation", "400", "unstable"]),
    ("search speed=1", ["--set", "KEY=VALUE"]),
    ("peg.shape=square; peg.diameter=0.01", ["peg.diameter = 0.01", "square", "peg.sides = [0.01, 0.01]"]),
    ("peg.shape=rectangular; hole.diameter=0.01", ["hole.diameter = 0.01", "hole.sides = [0.01, 0.01]"]),
    ("peg.sides=[0.008, 0.008]", ["peg.sides = [0.008, 0.008]", "round", "peg.diameter = 0.008"]),
    ("peg.sides=[0.008, 0.006]", ["peg.sides = [0.008, 0.006]", "round", "peg.diameter allowed"]),
    ("peg.shape=square; peg.sides=[0.006, 0.008]", ["peg.sides = [0.006, 0.008]", "not equal", '"rectangular"']),
    ("peg.shape=square; peg.sides=0.008", ["peg.sides = 0.008", "2 values", "0.002 to 0.03"]),
    (
        "peg.shape=rectangular; peg.sides=[0.012, 0.008]; hole.sides=[0.0121, 0.008]",
        ["peg.sides = [0.012, 0.008]", "0.008 is wider than the hole", "less than 0.008 of hole.sides"],
    ),
    (
        "peg.shape=rectangular; peg.sides=[0.012, 0.008]; hole.sides=[0.0081, 0.0121]",
        ["0.012 is wider than the hole", "less than 0.0081"],
    ),
    ("peg.shape=square; peg.chamfer=0.0005", ["peg.chamfer = 0.0005: not for a part with corners; 0, or a round"]),
    ("peg.shape=square; hole.chamfer=0.0005", ["hole.chamfer = 0.0005: not for a part with corners"]),
    (f"{THIN}; peg.chamfer=0.001", ["peg.chamfer = 0.001: leaves too little of the end; less than 0.001"]),
    ("hole.depth=0.002; hole.chamfer=0.002", ["no bore is left; less than hole.depth = 0.002 allowed"]),
    (LATCH % (5.9, 0.003), ["hole.latch.force = 5.9: too high to overcome", "push with 11 N; at most 5.83 allowed"]),
    (
        f"{LATCH % (5.0, 0.003)}; grasp.force=15.0",
        ["hole.latch.force = 5: too high to overcome: the pads transmit only", "at grasp.force = 15"],
    ),
    (f"{LATCH % (5.0, 0.003)}; limits.force=9.0", ["limits.force = 9; at most 4.17 allowed"]),
    (f"{LATCH % (5.0, 0.01)}; hole.depth=0.008", ["hole.latch.height = 0.01"]),
    ("sim.plate.shallow=0.02", ["sim.plate.shallow = 0.02"]),
    (PRIOR % "[0.531,0.0]", ["hole.prior.mean = [0.531, 0.0]", "along x; 0.47 to 0.53 allowed"]),
    (f"{WIDE}; {PRIOR % '[0.56,0.0]'}", ["hole.prior.mean", "outside the workspace along x; 0.2 to 0.55"]),
    *(
        (f"hole.prior={{mean=[0.5,0.0],deviation={wrong}}}", ["hole.prior.deviation"])
        for wrong in ("[0.0,0.001]", "[0.001,0.2]", "[0.001]")
    ),
    ("rack.first=[0.45, -0.1, 0.1]", ["rack.first = [0.45, -0.1, 0.1]: the rack overlaps the plate; slots outside x"]),
    ("search.gains.translation=1e20", ["translation = 1e+20: a number > 0 and <= 100000 allowed"]),
    ("search.gains.damping_ratio=6", ["search.gains: oscillates from", "times the torques with 2 ms of delay"]),
    ("world=moon", ["world = 'moon': no such file in worlds/; \"backlash\", "]),
]


@pytest.mark.parametrize(("sets", "told"), WRONG)
def test_a_wrong_value_is_refused_in_one_line(sets, told):
    line = line_about(*sets.split("; "))
    assert all(word in line for word in told), line


TAKEN = [
    PRIOR % "[0.53,-0.03]",
    f"{WIDE}; {PRIOR % '[0.55,0.0]'}",
    LATCH % (5.8, 0.003),
    f"{LATCH % (8.0, 0.003)}; grasp.force=45.0; adjust.push_offset=0.014",
    f"{THIN}; peg.chamfer=0.00099",
    "peg.diameter=0.002; hole.diameter=0.0021",
]
"""Places, latches and chamfers at the border of what is allowed."""


@pytest.mark.parametrize("sets", TAKEN)
def test_values_at_their_limits_are_accepted(sets):
    load(sets=sets.split("; "))


def test_chamfers_belong_to_peg_and_hole_with_none_by_default():
    job = load(sets=("peg.chamfer=0.0005", "hole.chamfer=0.001")).cell.job()
    assert (job.peg.part, job.hole.part) == (Round(0.008, 5e-4), Round(0.0081, 1e-3))
    plain = load().cell.job()
    assert (plain.peg.part, plain.hole.part) == (Round(0.008), Round(0.0081))


@pytest.mark.parametrize(
    ("at", "beyond", "told"),
    [
        ("limits.force=136", "limits.force=137", "at most 136 allowed"),
        ("limits.high=[1.08, 0.45, 1.42]", "limits.high=[1.1, 0.45, 1.42]", "1.1 along x: Franka Emika Panda never"),
        ("limits.high=[1.08, 0.45, 1.42]", "limits.high=[1.08, 0.45, 1.43]", "along z: {reach} -0.76 to 1.42 allowed"),
        ("limits.low=[0.2, -1.08, -0.75]", "limits.low=[0.2, -1.1, -0.75]", "along y: {reach} -1.09 to 1.09 allowed"),
    ],
)
def test_limits_beyond_the_arm_are_refused(at, beyond, told):
    load(sets=[at])
    arm = "Franka Emika Panda"
    assert told.format(arm=arm, reach=f"{arm} never reaches so far;") in line_about(beyond)


def test_a_file_that_is_missing_or_not_toml_is_named(tmp_path):
    path = tmp_path / "cell.toml"
    assert "cannot be read: No such file" in line_about(path=path)
    path.write_text("peg = ")
    assert str(path) in line_about(path=path)


def test_file_then_preset_then_recipe_then_keys(tmp_path):
    cell = tmp_path / "cell.toml"
    cell.write_text('preset = "slow"\n' + DEFAULT.read_text())
    layer(tmp_path, "presets", "slow", "[search]\nspeed = 0.011\ntimeout = 11.0\n")
    layer(tmp_path, "recipes", 65535, "[search]\ntimeout = 12.0\nheight = 0.012\n")
    found = load(cell, sets=["search.height=0.013"])
    search = found.recipes[65535].search
    assert (search.speed, search.timeout, search.height) == (0.011, 12.0, 0.013)
    assert found.cell.search.timeout == 11.0


def test_a_command_replaces_single_values_and_no_limit(loaded):
    assert with_parameters(loaded.cell, [("search.timeout", 5.0)]).search.timeout == 5.0
    with pytest.raises(ConfigError, match=r"limits\.force: not for a command"):
        with_parameters(loaded.cell, [("limits.force", 500.0)])


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("3", '[arm]\nkind = "sim"', "arm: not for a recipe"),
        *((name, "", "named by their number; 01.toml to 65535.toml allowed") for name in ("0", "65536", "²")),
        ("01", "", "/recipes/1.toml: recipe 1 is 01.toml, too; one file for each number allowed"),
    ],
)
def test_a_recipe_of_hardware_or_without_own_number_is_refused(name, text, told, tmp_path):
    shutil.copytree(DEFAULT.parent, tmp_path, dirs_exist_ok=True)
    layer(tmp_path, "recipes", name, text)
    assert told in line_about(path=tmp_path / DEFAULT.name)


def test_certificates_are_looked_for_beside_the_config_file(tmp_path):
    file = tmp_path / "cell.toml"
    tls = '\n[plc.tls]\ncertificate = "cell.pem"\nkey = "/keys/cell.key"\nauthority = "ca/root.pem"\n'
    file.write_text(DEFAULT.read_text() + tls)
    cell = load(file).cell
    for config in (cell, with_parameters(cell, [("grasp.force", 20.0)])):
        found = config.plc.tls
        assert (found.certificate, found.authority) == (tmp_path / "cell.pem", tmp_path / "ca/root.pem")
        assert str(found.key) == "/keys/cell.key"


@pytest.fixture
def without_switch(tmp_path):
    """Return the file of a cell without the section of its switch."""
    path = tmp_path / "cell.toml"
    path.write_text(re.sub(r'\[switch\]\nkind = "sim".*\n', "", DEFAULT.read_text()))
    return path


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("switch={kind='modem'}", ["switch.kind = 'modem'", '"none", "serial", "sim" allowed']),
        ("switch={}", ["switch.kind", "missing", '"none", "serial", "sim" needed']),
        ("switch={kind='serial'}", ["switch.port", "missing"]),
        (
            "switch={kind='serial', port='/dev/ttyUSB0', baud=9600}",
            ["switch.baud", "unknown key", "kind, port, record allowed"],
        ),
    ],
)
def test_a_wrong_kind_of_device_is_refused_in_one_line(wrong, told, without_switch):
    line = line_about(wrong, path=without_switch)
    assert all(word in line for word in told), line


def test_a_simulated_device_needs_neither_section_nor_calibration(without_switch):
    assert load(without_switch, simulate=["switch"]).cell.switch.kind == "sim"
    without_switch.write_text(f"calibration = 3\n{without_switch.read_text()}")
    with pytest.raises(ConfigError, match=r"^[^\n]*: calibration = 3: a section with[^\n]*$"):
        load(without_switch, simulate=["switch"])


def test_gains_beyond_the_sampled_loops_margin_are_refused_with_the_figure():
    with pytest.raises(ConfigError) as refused:
        load(sets=["insert.gains.translation=20000"])
    found = re.fullmatch(
        r"--set: insert\.gains\.translation = 20000: unstable from (\S+) with this damping ratio and frames at 10 Hz; at most (\S+) allowed",
        str(refused.value),
    )
    assert found
    limit, allowed = map(float, found.groups())
    assert limit == pytest.approx(1.2 * allowed, rel=0.01)
    load(sets=[f"insert.gains.translation={0.99 * allowed}"])
    load(sets=["insert.gains.rotation=200", "skin.rate=100"])  # frames come faster
    with pytest.raises(ConfigError, match="at most"):
        load(sets=[f"insert.gains.translation={1.01 * allowed}"])


def test_gains_are_judged_at_the_cells_own_arm_and_place():
    shipped, other, nearer = (load(sets=sets).cell.place() for sets in ([], ["arm.model=fr3"], NEARER))
    inertia, another, bent = (inertias(place)[1][2, 2] for place in (shipped, other, nearer))
    assert another > 1.02 * inertia
    assert abs(bent / inertia - 1.0) > 0.02


def test_a_custom_arm_is_a_file_beside_the_config(tmp_path):
    text = arm_file("panda").read_text()
    (tmp_path / "own.toml").write_text(text.replace("flange = 0.107", "flange = 0.117"))
    (tmp_path / "cell.toml").write_text(DEFAULT.read_text().replace("[arm]\n", '[arm]\nmodel = "own.toml"\n'))
    cell = load(tmp_path / "cell.toml").cell
    for config in (cell, with_parameters(cell, [("grasp.force", 20.0)])):
        assert config.arm_model().kinematics.flange == 0.117


@pytest.fixture
def real(tmp_path):
    """Return a file of a physical cell, which the shipped one is the base of."""
    path = tmp_path / "cell_07.toml"
    path.write_text((SHIPPED / "cell_01.toml").read_text())
    return path


def test_a_cell_takes_missing_keys_from_its_base(real):
    cell, base = load(real).cell, load().cell
    assert (cell.search, cell.insert, cell.adjust) == (base.search, base.insert, base.adjust)
    assert (cell.arm.kind, base.arm.kind) == ("franka", "sim")


@pytest.mark.parametrize("pace", ["1.0", "max"])
def test_a_physical_cell_is_timed_at_any_pace_of_its_base(real, pace):
    physical, simulated = load(real, sets=[f"sim.pace={pace}"]).cell, load(sets=[f"sim.pace={pace}"]).cell
    assert (physical.is_simulated, simulated.is_simulated) == (False, True)
    assert (physical.first_seed, simulated.first_seed) == (0, 1)
    assert is_timed(physical)
    assert is_timed(simulated) == (pace == "1.0")


def test_a_wrong_value_of_the_base_names_the_base(real):
    shutil.copy(DEFAULT, real.parent / "sim.toml")
    (real.parent / "sim.toml").write_text(DEFAULT.read_text().replace("timeout = 100.0", "timeout = -1.0"))
    assert line_about(path=real).startswith(f"{real.parent / 'sim.toml'}: search.timeout")


@pytest.mark.parametrize("key", ["force", "low", "high", "centre", "first"])
def test_limits_and_places_are_never_those_of_the_base(real, key):
    real.write_text("\n".join(line for line in real.read_text().splitlines() if not line.startswith(f"{key} =")))
    line = line_about(path=real)
    assert line.startswith(f"{real}: ")
    assert f".{key}: missing" in line


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('base = "sun.toml"', "base = 'sun.toml': no such file; cell_01.toml, sim.toml allowed"),
        ('base = "cell_01.toml"', "has a base of its own"),
    ],
)
def test_a_missing_or_nested_base_is_refused(real, text, told):
    real.write_text(text)
    assert told in line_about(path=real)


def cell_file(folder, peg="", hole=""):
    """Write a cell on the shipped base that says this of its part, and return the file."""
    path = folder / "cell.toml"
    path.write_text(
        'base = "sim.toml"\n[limits]\nforce = 60.0\nlow = [0.20, -0.50, 0.05]\nhigh = [0.80, 0.45, 0.80]\n'
        f"[rack]\nfirst = [0.45, -0.25, 0.10]\n[peg]\n{peg}\n[hole]\ncentre = [0.5, 0.0, 0.1]\n{hole}\n"
    )
    return path


def sizes(*sets, path=None):
    cell = load(path, sets=sets).cell
    return (cell.peg.diameter or cell.peg.sides), (cell.hole.diameter or cell.hole.sides)


@pytest.mark.parametrize(
    ("sets", "peg", "hole"),
    [
        (("peg.shape=square",), (0.008, 0.008), (0.0081, 0.0081)),
        (("peg.shape=rectangular",), (0.008, 0.008), (0.0081, 0.0081)),
        (("peg.shape=rectangular", "peg.sides=[0.006, 0.008]"), (0.006, 0.008), (0.0081, 0.0081)),
        (
            ("peg.shape=rectangular", "peg.sides=[0.004, 0.008]", "hole.sides=[0.0041, 0.0081]"),
            (0.004, 0.008),
            (0.0041, 0.0081),
        ),
        (
            ("peg.shape=rectangular", "peg.sides=[0.02, 0.008]", "hole.sides=[0.0201, 0.0081]"),
            (0.02, 0.008),
            (0.0201, 0.0081),
        ),
    ],
)
def test_a_layer_changes_of_shape_and_size_what_it_states(sets, peg, hole):
    assert sizes(*sets) == (peg, hole)


OBLONG = ("peg.shape=rectangular", "peg.sides=[0.008, 0.012]", "hole.sides=[0.0081, 0.0121]")


@pytest.mark.parametrize(
    ("sets", "azimuth"), [((), 0.4), (("peg.shape=square",), 0.0), (OBLONG, 0.0), (OBLONG, -3.1415), (OBLONG, 0.0009)]
)
def test_a_search_may_turn_a_peg_by_its_symmetry(sets, azimuth):
    assert load(sets=(*sets, f"search.tilt_azimuth={azimuth}")).cell.params(SEARCH).tilt_azimuth == azimuth


@pytest.mark.parametrize(
    ("sets", "azimuth", "allowed"),
    [(("peg.shape=square",), 0.4, 1.5708), (OBLONG, 1.5708, 3.1416), (OBLONG, -0.0011, 3.1416)],
)
def test_a_search_with_a_peg_turned_otherwise_is_refused(sets, azimuth, allowed):
    with pytest.raises(
        ConfigError, match=rf"^--set: search\.tilt_azimuth = {azimuth}: .* multiples of {allowed} allowed"
    ):
        load(sets=(*sets, f"search.tilt_azimuth={azimuth}"))


def test_equal_sides_become_the_diameter_of_a_round_peg(tmp_path):
    path = cell_file(tmp_path, 'shape = "square"\nsides = [0.01, 0.01]', "sides = [0.0101, 0.0101]")
    assert sizes("peg.shape=round", path=path) == (0.01, 0.0101)


def test_unequal_sides_below_leave_a_round_peg_without_its_diameter(tmp_path):
    path = cell_file(tmp_path, 'shape = "rectangular"\nsides = [0.012, 0.008]', "sides = [0.0121, 0.0081]")
    line = line_about("peg.shape=round", path=path)
    assert all(word in line for word in ("--set", "peg.diameter: missing", "peg.sides was [0.012, 0.008]")), line


def test_a_recipe_sizes_its_own_shape_whatever_the_cell_has(tmp_path):
    path = cell_file(tmp_path)
    text = '[peg]\nshape = "rectangular"\nsides = [0.012, 0.008]\n[hole]\nsides = [0.0121, 0.0081]\n'
    layer(tmp_path, "recipes", 7, text)
    loaded = load(path)
    assert (loaded.cell.peg.diameter, loaded.recipes[7].peg.sides) == (0.008, (0.012, 0.008))


def test_a_parameter_of_a_command_must_fit_the_cells_shape():
    square = load(sets=("peg.shape=square",)).cell
    assert with_parameters(square, [("hole.yaw", 0.1)]).hole.sides == (0.0081, 0.0081)
    with pytest.raises(ConfigError, match=r"parameter: peg\.diameter = 0\.0079: .*peg\.sides = \[0\.0079, 0\.0079\]"):
        with_parameters(square, [("peg.diameter", 0.0079)])


def test_a_square_peg_without_its_section_is_refused(tmp_path):
    shutil.copytree(SHIPPED, tmp_path / "config")
    path = tmp_path / "config" / "sim.toml"
    path.write_text(re.sub(r"\[corner\].*?(?=\[arm\])", "", path.read_text(), flags=re.DOTALL))
    load(path)
    line = line_about("peg.shape=square", path=path)
    assert all(word in line for word in ("[corner]", "missing", "square"))


@pytest.mark.parametrize(("name", "figure"), [("translation", "stiffness"), ("rotation", "turn_stiffness")])
def test_no_gain_is_stiffer_than_the_arm_may_be(name, figure):
    config = load().cell
    gains, arm = config.followed()["search.gains"], config.arm_model()
    most = getattr(arm, figure)
    require_permitted({"a": gains.model_copy(update={name: most})}, arm)
    with pytest.raises(
        ValueError, match=rf"^a\.{name} = {most + 1.0:g}: more than {figure} of .*; at most {most:g} allowed$"
    ):
        require_permitted({"a": gains.model_copy(update={name: most + 1.0})}, arm)
