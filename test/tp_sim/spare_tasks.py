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
        }
    }
}
