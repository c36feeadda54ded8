"""A small arm as a URDF: a fixed mount, a mimic joint, a mesh that does not exist."""

ARM = """
<robot name="arm">
  <link name="world"/>
  <link name="base"><visual><geometry><mesh filename="package://none/no.dae"/></geometry></visual>
  </link>
  <link name="upper"/>
  <link name="lower"/>
  <link name="finger"/>
  <link name="thumb"/>
  <joint name="mount" type="fixed"><parent link="world"/><child link="base"/>
    <origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/></joint>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit effort="1" velocity="2"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="1 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" effort="1" velocity="3"/></joint>
  <joint name="grip" type="prismatic"><parent link="lower"/><child link="finger"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.1" effort="1" velocity="0.2"/></joint>
  <joint name="grip_mirror" type="prismatic"><parent link="lower"/><child link="thumb"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 -1 0"/><mimic joint="grip"/>
    <limit lower="0" upper="0.1" effort="1" velocity="0.2"/></joint>
</robot>
"""
