"""An oscillation of the real nodes is told, with its cause, and no longer when it is over."""

from tp_sim.harness import ClosedLoop

SHAKY = {
    'tp_sim': {'plant': {'delay': 3}},
    'tp_controller': {'tasks': {'ee_position': {'gain': [30.0]}}},
}


def test_an_undeclared_delay_is_named_until_the_gain_is_lowered(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', SHAKY) as loop:
        loop.send_goal('ee_position', [1.0, 0.6])
        for _ in range(200):
            loop.step(10)
            if 'times per second' in loop.state.message:
                break
        message = loop.state.message
        assert 'reverses' in message
        assert 'moves 50 ms after its commands' in message
        assert 'tasks.ee_position.gain below 7.3' in message
        assert 'robot.delay: 0.05' in loop.controller.output
        loop.set_parameters({'tasks.ee_position.gain': [5.0]})
        for _ in range(60):
            loop.step(10)
            if not loop.state.message:
                break
        loop.run(2.0)
        assert 'times per second' not in loop.state.message
