"""The three mechanisms of the benchmark: the believed models.

Units are SI; there is no damping, friction, contact or limit.
"""

_OPTIONS = """  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"><flag contact="disable"/></option>
  <default><geom type="capsule" size="0.02" contype="0" conaffinity="0" group="1"/></default>
"""

SLIDER = f"""<mujoco model="slider">
{_OPTIONS}  <worldbody>
    <body name="carriage">
      <joint name="slide" type="slide" axis="1 0 0" armature="0.3"/>
      <inertial pos="0 0 0" mass="2" diaginertia="0.004 0.004 0.004"/>
      <geom fromto="-0.05 0 0 0.05 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""

PENDULUM = f"""<mujoco model="pendulum">
{_OPTIONS}  <worldbody>
    <body name="arm">
      <joint name="hinge" type="hinge" axis="0 1 0" armature="0.02"/>
      <inertial pos="0 0 -0.4" mass="1" diaginertia="0.006 0.006 0.001"/>
      <geom fromto="0 0 0 0 0 -0.5"/>
    </body>
  </worldbody>
</mujoco>
"""

TWO_LINK = f"""<mujoco model="two_link">
{_OPTIONS}  <worldbody>
    <body name="upper">
      <joint name="shoulder" type="hinge" axis="0 1 0" armature="0.05"/>
      <inertial pos="0 0 -0.2" mass="1.5" diaginertia="0.02 0.02 0.002"/>
      <geom fromto="0 0 0 0 0 -0.4"/>
      <body name="fore" pos="0 0 -0.4">
        <joint name="elbow" type="hinge" axis="0 1 0" armature="0.03"/>
        <inertial pos="0 0 -0.175" mass="1" diaginertia="0.0102 0.0102 0.001"/>
        <geom fromto="0 0 0 0 0 -0.35"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

MECHANISMS = {"slider": SLIDER, "pendulum": PENDULUM, "two_link": TWO_LINK}
JOINTS = {"slider": 1, "pendulum": 1, "two_link": 2}
# kg, masses of the joints' bodies
MASSES = {("slider", 0): 2.0, ("pendulum", 0): 1.0, ("two_link", 0): 1.5, ("two_link", 1): 1.0}
