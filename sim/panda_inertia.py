"""Masses of the Panda, for the stand-in only.

Link inertials: the maker's inertial description as carried by google-deepmind/mujoco_menagerie,
franka_emika_panda/panda.xml, commit 1b428b0.
That model's armature and damping are placeholders, not measurements; none are used here.
"""

LINKS: tuple[tuple[float, tuple[float, float, float], tuple[float, float, float, float, float, float]], ...] = (
    (4.970684, (0.003875, 0.002081, -0.04762), (0.70337, 0.70661, 0.009117, -0.000139, 0.006772, 0.019169)),
    (0.646926, (-0.003141, -0.02872, 0.003495), (0.007962, 0.02811, 0.025995, -0.003925, 0.010254, 0.000704)),
    (3.228604, (0.027518, 0.039252, -0.066502), (0.037242, 0.036155, 0.01083, -0.004761, -0.011396, -0.012805)),
    (3.587895, (-0.05317, 0.104419, 0.027454), (0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641)),
    (1.225946, (-0.011953, 0.041065, -0.038437), (0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229)),
    (1.666555, (0.060149, -0.014117, -0.010517), (0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341)),
    (0.735522, (0.010517, -0.004252, 0.061597), (0.012516, 0.010027, 0.004815, -0.000428, -0.001196, -0.000741)),
)
"""Mass, kg; centre of mass, m; inertia about it (xx, yy, zz, xy, xz, yz), kg·m²; all in the link's frame."""
HAND_MASS = 0.73
HAND_COM = (-0.01, 0.0, 0.03)
HAND_INERTIA = (0.001, 0.0025, 0.0017)
FINGER_MASS = 0.015
"""Of each finger, kg."""
