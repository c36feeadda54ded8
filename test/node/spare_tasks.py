"""Changes that give A3 an idle task of every other type."""

SPARE_TASKS = {
    'tp_controller': {
        'tasks': {
            'hand_pose': {
                'type': 'pose',
                'frame': 'link_3',
                'position_axes': 'xy',
                'orientation_axes': 'z',
            },
            'hand_rotation': {'type': 'orientation', 'frame': 'link_3', 'axes': 'xyz'},
            'elbow': {'type': 'joint', 'joints': ['joint_2', 'joint_3']},
            'look': {'type': 'gaze', 'frame': 'link_2', 'axis': 'x'},
            'home': {'type': 'posture'},
            'agility': {'type': 'manipulability', 'frame': 'link_3', 'position_axes': 'xy'},
            'from_elbow': {
                'type': 'position',
                'frame': 'link_3',
                'axes': 'xy',
                'relative_to': 'link_1',
            },
            'along_hand': {
                'type': 'position',
                'frame': 'link_3',
                'axes': 'x',
                'axes_frame': 'link_3',
            },
        }
    }
}
