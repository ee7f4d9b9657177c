"""Access to MuJoCo's structs from compiled code: offsets of the arrays, and pointers.

Numba's cache on disk does not detect a changed constant of another package. The byte offsets are therefore literals of
this file, valid for one release of MuJoCo, and verified against the running library on import.
"""

import ctypes
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding
import mujoco
import numpy as np
from numba import carray, types
from numba.core import cgutils
from numba.extending import intrinsic

from drivers.compiled import cfunc, njit

logger = logging.getLogger(__name__)

MUJOCO_VERSION = "3.17.0"

MODEL_GEOM_USER = 2616
MODEL_GEOM_SIZE = 2528
MODEL_GEOM_BODYID = 2448
MODEL_BODY_ROOTID = 1816
DATA_GEOM_XPOS = 160896
DATA_GEOM_XMAT = 160904
DATA_CVEL = 161280
DATA_SUBTREE_COM = 160960
DATA_USERDATA = 160800
DATA_NCON = 160560
DATA_CONTACT = 161472
DATA_EFC_FORCE = 162080
CONTACT_BYTES = 584

CONTACT_FIELDS: dict[str, tuple[int, Any]] = {
    "dist": (0, "f8"), "pos": (8, ("f8", 3)), "frame": (32, ("f8", 9)), "includemargin": (104, "f8"),
    "friction": (112, ("f8", 5)), "solref": (152, ("f8", 2)), "solreffriction": (168, ("f8", 2)),
    "solimp": (184, ("f8", 5)), "adhesion": (224, "f8"), "mu": (232, "f8"), "H": (240, ("f8", 36)), "dim": (528, "i4"),
    "geom1": (532, "i4"), "geom2": (536, "i4"), "geom": (540, ("i4", 2)), "flex": (548, ("i4", 2)),
    "elem": (556, ("i4", 2)), "vert": (564, ("i4", 2)), "exclude": (572, "i4"), "efc_address": (576, "i4"),
}  # fmt: skip
"""Byte offset and type of each field of an mjContact."""
CONTACT = np.dtype(
    {
        "names": list(CONTACT_FIELDS),
        "formats": [form for _, form in CONTACT_FIELDS.values()],
        "offsets": [place for place, _ in CONTACT_FIELDS.values()],
        "itemsize": CONTACT_BYTES,
    }
)
"""Layout of an mjContact in compiled code."""

_BALL = """<mujoco><worldbody><geom type="plane" size="1 1 1"/>
<body pos="0 0 .09"><freejoint/><geom size=".1"/></body></worldbody></mujoco>"""
_PROBE = """<mujoco><size nuser_geom="8" nuserdata="8"/><worldbody><geom type="ellipsoid" size="1 1 1"/>
<camera/><light/><site name="here"/><body name="ball"><freejoint/><geom type="cylinder" size=".1 .1"/><site name="there"/>
<body><joint name="hinge"/><geom size=".1"/></body></body><body mocap="true"/></worldbody>
<tendon><spatial name="string"><site site="here"/><site site="there"/></spatial></tendon>
<actuator><general joint="hinge" dyntype="filter"/></actuator><sensor><jointpos joint="hinge"/></sensor>
<equality><connect body1="ball" anchor="0 0 0"/></equality></mujoco>"""
"""Model with one element of every kind: an empty array would have its neighbour's address and prove nothing."""


def library_path() -> Path:
    """Return the MuJoCo library that the Python package has loaded."""
    return next(Path(mujoco.__file__).parent.glob("libmujoco.so*"))


@cache
def _collision(hook: Callable[..., Any]) -> Any:
    """Return `hook`, compiled with the signature of MuJoCo's collision table and kept for the life of the process."""
    integer, address = types.int32, types.intp
    signature = integer(address, address, address, integer, integer, types.float64)
    return cfunc(signature, cache=True)(hook)


def collide_by(plate: mujoco.mjtGeom, peg: mujoco.mjtGeom, function: Callable[..., Any]) -> None:
    """Compile a function and install it in this process's collision table for a pair of geom types."""
    count = int(mujoco.mjtGeom.mjNGEOMTYPES)
    table = (ctypes.c_void_p * (count * count)).in_dll(ctypes.CDLL(str(library_path())), "mjCOLLISIONFUNC")
    table[int(plate) * count + int(peg)] = _collision(function).address


def verify_layout() -> None:
    """Verify the offsets of this file against the loaded library.

    Raises:
        ImportError: The release of the library differs from that of this file's offsets.
    """
    found = mujoco.mj_versionString()
    if found != MUJOCO_VERSION:
        raise ImportError(
            f"mujoco {found} found, {MUJOCO_VERSION} needed: the exact contacts rely on its memory layout"
        )
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    for address, array in (
        (model._address + MODEL_GEOM_USER, model.geom_user),
        (model._address + MODEL_GEOM_SIZE, model.geom_size),
        (model._address + MODEL_GEOM_BODYID, model.geom_bodyid),
        (model._address + MODEL_BODY_ROOTID, model.body_rootid),
        (data._address + DATA_GEOM_XPOS, data.geom_xpos),
        (data._address + DATA_GEOM_XMAT, data.geom_xmat),
        (data._address + DATA_CVEL, data.cvel),
        (data._address + DATA_SUBTREE_COM, data.subtree_com),
        (data._address + DATA_USERDATA, data.userdata),
    ):
        if ctypes.c_uint64.from_address(address).value != array.ctypes.data:
            raise ImportError(f"mujoco {found}: its structs are not laid out as in sim/world/native.py")
    _verify_contacts(found)


def _verify_contacts(found: str) -> None:
    """Verify the offsets of contacts and their forces on a ball that lies on a plane."""
    model = mujoco.MjModel.from_xml_string(_BALL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    contact = data.contact
    first = contact.dist.ctypes.data
    right = (
        ctypes.c_int32.from_address(data._address + DATA_NCON).value == data.ncon == 1
        and ctypes.c_uint64.from_address(data._address + DATA_CONTACT).value == first
        and ctypes.c_uint64.from_address(data._address + DATA_EFC_FORCE).value == data.efc_force.ctypes.data
        and contact.dist.strides == (CONTACT_BYTES,)
        and all(getattr(contact, name).ctypes.data - first == place for name, (place, _) in CONTACT_FIELDS.items())
    )
    if not right:
        raise ImportError(f"mujoco {found}: its contacts are not laid out as in sim/world/native.py")


def log_warnings() -> None:
    """Send MuJoCo's warnings to the log instead of the terminal and a file in the current folder.

    A state that is no longer finite ends the run by itself. "Linesearch objective is not convex" comes from the solver.
    The second derivative of the cost of a contact on the edge of its friction cone is then not positive, which only
    rounding can cause. MuJoCo replaces it by a small positive number and continues the search.
    """
    mujoco.set_mju_user_warning(lambda text: logger.debug("MuJoCo: %s", text))


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress MuJoCo's warnings on the terminal and in a log file, for tests that push models until they fail."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def step_time(data: mujoco.MjData) -> float:
    """Return the wall time of `mj_step` on this data, s; see `clocked`."""
    return float(data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration)


@intrinsic
def pointer(typingctx, address):  # type: ignore[no-untyped-def]
    """Convert an integer address to a pointer, for `numba.carray`."""
    signature = types.voidptr(address)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return signature, codegen


@njit(cache=True)
def load(address):  # type: ignore[no-untyped-def]
    """Return the pointer stored at an address, as an integer."""
    return carray(pointer(address), (1,), np.int64)[0]


@njit(cache=True)
def array(address, shape):  # type: ignore[no-untyped-def]
    """Return a float64 view of this shape of the array whose pointer is stored at an address."""
    return carray(pointer(load(address)), shape, np.float64)


@njit(cache=True)
def contacts(data):  # type: ignore[no-untyped-def]
    """Return a view of an mjData's contacts of this step, shape (ncon,), of `CONTACT`."""
    count = carray(pointer(data + DATA_NCON), (1,), np.int32)[0]
    return carray(pointer(load(data + DATA_CONTACT)), (count,), CONTACT)


@njit(cache=True)
def contact_force(data, contact):  # type: ignore[no-untyped-def]
    """Return the force of a contact along its three axes, the normal first, shape (3,), N."""
    return carray(pointer(load(data + DATA_EFC_FORCE) + 8 * contact.efc_address), (3,), np.float64)


verify_layout()
_timer = ctypes.c_void_p.in_dll(ctypes.CDLL(str(library_path())), "mjcb_time")
_clock, _timer.value = _timer.value, None
"""Wall clock that the Python package sets in MuJoCo, which reads it thirty times a step; only profiling needs it."""


@contextmanager
def clocked() -> Iterator[None]:
    """Enable MuJoCo's timers of its stages (`mjData.timer`) within this context."""
    _timer.value = _clock
    try:
        yield
    finally:
        _timer.value = None


llvmlite.binding.load_library_permanently(str(library_path()))
add_contact = types.ExternalFunction("mj_addContact", types.int32(types.intp, types.intp, types.intp))
step = types.ExternalFunction("mj_step", types.void(types.intp, types.intp))
update_velocities = types.ExternalFunction("mj_comVel", types.void(types.intp, types.intp))
NUSERDATA = 96
assert np.dtype(np.intp).itemsize == 8
