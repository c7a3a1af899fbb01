"""The rigid body in C: a recursion of Newton's and Euler's equations from link to link.

The recursion (Luh, Walker and Paul 1980) runs over constant tables, so that the program is the same
text for every robot, and can be read beside a textbook.
"""

import numpy as np

from jaxidl.errors import ConfigurationError
from jaxidl.robot.c.text import table, whole
from jaxidl.systems import PointMass, RigidBody
from jaxidl.systems.chain import Chain, chain
from jaxidl.systems.mujoco_body import MujocoBody

_POINT = """\
static void rigid_body(const real q[J], const real qd[J], const real qdd[J], real tau[J])
{
    int j;
    (void)q;
    (void)qd;
    for (j = 0; j < J; j++) tau[j] = mass[j] * qdd[j];
}
"""

_RECURSION = """/* out = a x b */
static void cross(const real a[3], const real b[3], real out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* out = w' x r + w x (w x r): what a rotation adds to the acceleration at r */
static void spin(const real w[3], const real wd[3], const real r[3], real out[3])
{
    real a[3], b[3];
    int k;
    cross(w, r, a);
    cross(w, a, b);
    cross(wd, r, a);
    for (k = 0; k < 3; k++) out[k] = a[k] + b[k];
}

/* A vector of a link's frame in the frame of the link that carries it (out = R v), or back. */
static void outwards(real R[3][3], const real v[3], real out[3])
{
    int i;
    for (i = 0; i < 3; i++) out[i] = R[0][i] * v[0] + R[1][i] * v[1] + R[2][i] * v[2];
}

static void inwards(real R[3][3], const real v[3], real out[3])
{
    int i;
    for (i = 0; i < 3; i++) out[i] = R[i][0] * v[0] + R[i][1] * v[1] + R[i][2] * v[2];
}

static void rigid_body(const real q[J], const real qd[J], const real qdd[J], real tau[J])
{
    static const real still[3] = {0, 0, 0};
    real R[J][3][3], r[J][3];           /* pose in the carrying link's frame */
    real w[J][3], wd[J][3], a[J][3];    /* angular velocity and acceleration, acceleration */
    real f[J][3], n[J][3];              /* force and torque that the joint transmits */
    real u[3], v[3];
    int i, j, k;

    for (j = 0; j < J; j++) { /* from the base to the tip: motion, and the wrench it takes */
        const int p = parent[j];
        const real *wp = p < 0 ? still : w[p], *wdp = p < 0 ? still : wd[p];
        const real *ap = p < 0 ? base_acceleration : a[p];
        const real m = inertial[j][0], *h = &inertial[j][1], *I = &inertial[j][4];
        const real move = q[j] - reference[j];
        const real c = hinge[j] ? M(cos)(move) : 1, s = hinge[j] ? M(sin)(move) : 0;

        for (i = 0; i < 3; i++) {
            R[j][i][0] = c * turn[j][i][0] + s * turn[j][i][1];
            R[j][i][1] = c * turn[j][i][1] - s * turn[j][i][0];
            R[j][i][2] = turn[j][i][2];
            r[j][i] = place[j][i] + (hinge[j] ? 0 : move * turn[j][i][2]);
        }
        spin(wp, wdp, r[j], u);
        for (k = 0; k < 3; k++) u[k] += ap[k];
        outwards(R[j], u, a[j]);
        outwards(R[j], wp, w[j]);
        outwards(R[j], wdp, wd[j]);
        if (hinge[j]) {
            wd[j][0] += w[j][1] * qd[j];
            wd[j][1] -= w[j][0] * qd[j];
            wd[j][2] += qdd[j];
            w[j][2] += qd[j];
        } else {
            a[j][0] += 2 * w[j][1] * qd[j];
            a[j][1] -= 2 * w[j][0] * qd[j];
            a[j][2] += qdd[j];
        }

        /* f = m a + w' x h + w x (w x h),  n = I w' + w x I w + h x a */
        spin(w[j], wd[j], h, f[j]);
        u[0] = I[0] * w[j][0] + I[3] * w[j][1] + I[4] * w[j][2];
        u[1] = I[3] * w[j][0] + I[1] * w[j][1] + I[5] * w[j][2];
        u[2] = I[4] * w[j][0] + I[5] * w[j][1] + I[2] * w[j][2];
        cross(w[j], u, n[j]);
        cross(h, a[j], v);
        n[j][0] += v[0] + I[0] * wd[j][0] + I[3] * wd[j][1] + I[4] * wd[j][2];
        n[j][1] += v[1] + I[3] * wd[j][0] + I[1] * wd[j][1] + I[5] * wd[j][2];
        n[j][2] += v[2] + I[4] * wd[j][0] + I[5] * wd[j][1] + I[2] * wd[j][2];
        for (k = 0; k < 3; k++) f[j][k] += m * a[j][k];
    }
    for (j = J - 1; j >= 0; j--) { /* from the tip to the base: what each joint must give */
        const int p = parent[j];
        tau[j] = (hinge[j] ? n[j][2] : f[j][2]) + armature[j] * qdd[j];
        if (p >= 0) {
            inwards(R[j], f[j], u);
            inwards(R[j], n[j], v);
            for (k = 0; k < 3; k++) {
                f[p][k] += u[k];
                n[p][k] += v[k];
            }
            cross(r[j], u, v);
            for (k = 0; k < 3; k++) n[p][k] += v[k];
        }
    }
}
"""


def rigid_body(body: RigidBody) -> str:
    """Return C of the inverse dynamics of ``body``: tables and the function ``rigid_body``.

    Raises:
        ConfigurationError: for a kind of body that has no C.
    """
    if type(body) is PointMass:
        return f"{table('mass', np.asarray(body.mass, float), 'mass of each axis')}\n{_POINT}"
    if type(body) is not MujocoBody:
        raise ConfigurationError(
            "a point mass or a rigid body read from MJCF or URDF",
            type(body).__name__,
            "read the model with jaxidl.systems.mjcf.read_model",
        )
    return f"{_tables(chain(body))}\n{_RECURSION}"


def _tables(links: Chain) -> str:
    hinge = [int(kind == "hinge") for kind in links.kinds]
    return "".join(
        (
            whole("parent", links.parent, "link that carries each link; -1: the base"),
            whole("hinge", hinge, "1: a hinge, 0: a slide; the axis is z of the link's frame"),
            table(
                "turn",
                _exact(links.turn),
                "frame of each link in its parent's frame, at the joint's reference: columns are"
                " its axes",
            ),
            table("place", _exact(links.place), "and its origin [m]"),
            table("reference", links.reference, "position where these hold [rad or m]"),
            table(
                "inertial",
                _exact(links.ten),
                "mass [kg], first moment [kg m], inertia xx, yy, zz, xy, xz, yz about the origin"
                " [kg m^2]",
            ),
            table("armature", links.armature, "inertia of the rotor [kg m^2 or kg]"),
            table(
                "base_acceleration",
                0.0 - links.gravity,
                "minus gravity: a base that is pushed up has the same weight [m/s^2]",
            ),
        )
    )


def _exact(x: np.ndarray) -> np.ndarray:
    """Return an array without the rounding of zeros, which nobody wants to read."""
    largest = np.abs(x).max(initial=0.0)
    return np.where(np.abs(x) < 1e-17 * largest, 0.0, x) + 0.0
