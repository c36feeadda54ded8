"""The pictures of the gallery, each a function that runs its experiment and draws it."""

import math

import numpy as np
from loop import Circle, Goal, simulate
from matplotlib.figure import Figure

from tp_controller.plots import planar
from tp_controller.plots.curves import least_distance
from tp_controller.plots.moments import Scene
from tp_controller.plots.style import LIMIT, RED, color, dash, shade, styled
from tp_controller.solvers import SOLVER_TYPES
from tp_controller.units import unit

PI = math.pi


def arm_and_errors(title, *made):
    """Arm at the end with its way, and error norms over time; one row for each run."""
    figure = Figure(figsize=(8.0, 0.5 + 2.7 * len(made)), layout='constrained')
    axes = figure.subplots(len(made), 2, squeeze=False, width_ratios=[1.0, 1.5])
    for (left, right), (name, one) in zip(axes, made, strict=True):
        scene = Scene(one.run, one.stack)
        low, high = planar.frame_of(scene)
        planar.draw_arm(left, scene, len(one.run.time) - 1, 0)
        left.set(
            xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel='x [m]', ylabel='y [m]',
            title=name,
        )  # fmt: skip
        errors(right, one)
    figure.suptitle(title)
    return figure


def errors(axes, made, names=None):
    """Error norms of tasks with a target over time."""
    tasks = [task for task in made.run.tasks if not task.distance.size and task.place >= 0]
    units = {}
    for i, task in enumerate(tasks):
        if names is None or task.name in names:
            units[task.name] = unit(task.type, made.stack.robot)
            axes.plot(
                made.run.time, task.error_norm, color=color(i), linestyle=dash(i),
                label=f'{task.name} [{units[task.name]}]',
            )  # fmt: skip
    all_units = ', '.join(dict.fromkeys(units.values()))
    axes.set(xlabel='time [s]', ylabel=f'error norm [{all_units}]', ylim=(0.0, None))
    axes.set_xlim(made.run.time[0], made.run.time[-1])
    axes.legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)


def a1():
    """A1: position of the end."""
    return arm_and_errors('Position', ('A1', simulate('a1_position', 10.0)))


def a2():
    """A2: position and angle of the end as one task of three rows."""
    return arm_and_errors('Configuration as one task', ('A2', simulate('a2_configuration', 10.0)))


def a3():
    """A3: position of the end, then its angle; at the second target both cannot hold."""
    file = 'a3_position_orientation'
    other = {'tasks__ee_orientation__target': [PI], 'settle': False}
    return arm_and_errors(
        'Position, then orientation',
        ('A3: angle π/2', simulate(file, 10.0)),
        ('A3′: angle π', simulate(file, 10.0, **other)),
    )


def a4():
    """A4: position of the end, then the first joint."""
    return arm_and_errors('Position, then joint 1', ('A4', simulate('a4_position_joint', 10.0)))


def a5():
    """A5: position of the end with the gains 1, 3 and 6, then the angle of link 2."""
    figure = Figure(figsize=(8.0, 3.4), layout='constrained')
    left, right = figure.subplots(1, 2)
    for i, gain in enumerate((1.0, 3.0, 6.0)):
        made = simulate('a5_link_orientation', 6.0, tasks__ee_position__gain=[gain])
        time, error = made.run.time, made.error('ee_position')
        below = time[np.flatnonzero(error >= 0.01)[-1] + 1]
        look = {'color': color(i), 'linestyle': dash(i)}
        left.plot(time, error, label=f'gain {gain:g}: below 0.01 m from {below:.2f} s', **look)
        left.plot(below, 0.01, 'o', color=color(i), markersize=4)
        right.plot(time, made.error('link2_orientation'), **look)
    left.axhline(0.01, color=LIMIT, linewidth=0.8, linestyle='--')
    left.set(xlabel='time [s]', ylabel='error norm [m]', title='ee_position', yscale='log')
    left.set_ylim(1e-4, 1.0)
    left.legend(loc='upper right', fontsize=8)
    right.set(xlabel='time [s]', ylabel='error norm [rad]', title='link2_orientation, gain 1')
    figure.suptitle('A5: gains of the first level')
    return figure


def b1():
    """B1: three circles to stay out of, then position of the end."""
    goals = ([-0.9, 0.9], [1.2, 0.6], [-0.3, -1.3], [0.2, 1.2])
    made = simulate(
        'b1_obstacles', 40.0, *(Goal(10.0 * i, 'ee_position', g) for i, g in enumerate(goals))
    )
    return arm_and_clearance(made, 'B1: clearance from three circles; the last goal lies inside')


def arm_and_clearance(made, title):
    """Arm and its way, error norm, and distances from what is kept clear of."""
    figure = Figure(figsize=(8.6, 4.4), layout='constrained')
    left, right = figure.subfigures(1, 2, width_ratios=[1.0, 1.3])
    axes = left.subplots()
    scene = Scene(made.run, made.stack)
    low, high = planar.frame_of(scene)
    planar.draw_arm(axes, scene, len(made.run.time) - 1)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel='x [m]', ylabel='y [m]')
    top, below = right.subplots(2, 1, sharex=True)
    errors(top, made)
    top.set_xlabel('')
    kept = [task for task in made.run.tasks if task.distance.size]
    for i, task in enumerate(kept):
        least = least_distance(task)
        below.plot(
            made.run.time, least, color=color(i), linestyle=dash(i),
            label=f'{task.name}: least {1e3 * np.nanmin(least):.2f} mm',
        )  # fmt: skip
    below.axhline(0.0, color=RED, linewidth=1.2)
    below.set(xlabel='time [s]', ylabel='clearance [m]', ylim=(-0.1, None))
    right.legend(*below.get_legend_handles_labels(), loc='outside lower center', ncols=2)
    figure.suptitle(title)
    return figure


def b2():
    """B2: the first joint in a range, then position of the end."""
    goals = ([1.0, 1.0], [1.2, -0.7], [-1.0, 1.0])
    made = simulate(
        'b2_joint_limits', 30.0, *(Goal(10.0 * i, 'ee_position', g) for i, g in enumerate(goals))
    )
    figure = Figure(figsize=(8.0, 4.4), layout='constrained')
    top, below = figure.subplots(2, 1, sharex=True)
    errors(top, made)
    top.set_xlabel('')
    task = made.run.task('joint_1_range')
    shade(below, made.run.time, task.active)
    below.plot(made.run.time, made.run.q[:, 0], color=color(0))
    for limit in (-0.5, 0.5):
        below.axhline(limit, color=RED, linestyle='--')
    below.set(xlabel='time [s]', ylabel='joint 1 [rad]')
    least = float(np.min(task.distance))
    figure.suptitle(
        f'B2: joint 1, at least {least:.2g} rad from the ends of its range; grey: the task acts'
    )
    return figure


def c1():
    """C1: tip, then last link; where both cannot hold, only task priority keeps the tip."""
    figure = Figure(figsize=(8.0, 3.4), layout='constrained')
    panels = figure.subplots(1, 2)
    for panel, target in zip(panels, ([2.5, 1.2], [3.3, 1.0]), strict=True):
        for i, scheme in enumerate(('augmented', 'recursive')):
            made = simulate(
                'c1_algorithmic_singularity', 20.0, Goal(0.0, 'tip', target), settle=False,
                solver__type=scheme,
            )  # fmt: skip
            for j, task in enumerate(('tip', 'last_link')):
                panel.plot(
                    made.run.time, np.maximum(made.error(task), 1e-9), color=color(i),
                    linestyle=dash(j), label=f'{scheme}: {task} [{"rad" if j else "m"}]',
                    linewidth=4.0 - 2.6 * i,
                )  # fmt: skip
        panel.set(
            title=f'tip to ({target[0]}, {target[1]})', xlabel='time [s]', yscale='log',
            ylabel='error norm [m, rad]', ylim=(1e-7, 4.0),
        )  # fmt: skip
    handles = panels[0].get_legend_handles_labels()
    figure.legend(*handles, loc='outside lower center', ncols=2)
    figure.suptitle('C1: algorithmic singularity on the right')
    return figure


def c2():
    """C2: the tip goes round a circle, and the long links stay still."""
    made = simulate('c2_macro_micro', 10.0, Circle('tip', 0.05, 5.0))
    figure = Figure(figsize=(8.0, 3.4), layout='constrained')
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.3])
    scene = Scene(made.run, made.stack)
    planar.draw_arm(left, scene, len(made.run.time) - 1, 0)
    left.set(xlabel='x [m]', ylabel='y [m]')
    moved = np.abs(made.run.q - made.run.q[0])
    for i, joint in enumerate(made.run.joints):
        right.plot(
            made.run.time, np.maximum(moved[:, i], 1e-17), color=color(i), linestyle=dash(i),
            label=joint,
        )  # fmt: skip
    right.set(xlabel='time [s]', ylabel='way from the start [rad]', yscale='log')
    right.legend(loc='center right')
    most = float(moved[:, :2].max())
    figure.suptitle(f'C2: the macro joints move by {most:g} rad')
    return figure


def c3():
    """C3: ten rounds of the tip; the pseudo-inverse drifts, the extended Jacobian returns."""
    period = math.tau
    ends = period * np.arange(11)
    figure = Figure(figsize=(8.0, 3.2), layout='constrained')
    axes = figure.subplots()
    for i, (scheme, name) in enumerate(
        (('recursive', 'pseudo-inverse'), ('extended_jacobian', 'extended Jacobian'))
    ):
        made = simulate(
            'c3_repeatability', 10.0 * period + 0.01, Circle('tip', 0.3, period),
            solver__type=scheme,
        )  # fmt: skip
        q = np.array([np.interp(ends, made.run.time, joint) for joint in made.run.q.T]).T
        # The extended Jacobian first comes to where its condition holds.
        first = i
        way = np.linalg.norm(q[first + 1 :] - q[first], axis=1)
        since = 'the start' if first == 0 else 'the end of the first round'
        axes.plot(
            np.arange(first + 1, 11), way, 'os'[i], linestyle=dash(i), color=color(i),
            label=f'{name}: {way[-1]:.2g} rad from {since} after ten rounds',
        )  # fmt: skip
    axes.set(
        xlabel='rounds [-]', ylabel='way of the joints [rad]', yscale='log', ylim=(1e-10, 1.0),
        xticks=range(1, 11),
    )  # fmt: skip
    figure.legend(loc='outside lower center')
    figure.suptitle('C3: how far the joints are from where they were')
    return figure


def d():
    """D: errors of two small arms under three gains, with and without damping."""
    figure = Figure(figsize=(8.0, 3.6), layout='constrained')
    panels = figure.subplots(1, 2, sharey=True)
    for panel, arm in zip(panels, ('rr', 'prr'), strict=True):
        for i, gain in enumerate((0.5, 1.0, 10.0)):
            for j, damping in enumerate((0.0, 0.01)):
                made = simulate(
                    f'd_{arm}', 10.0, settle=False, tasks__hand__gain=[gain],
                    solver__damping=damping,
                )  # fmt: skip
                name = 'pinv' if damping == 0.0 else 'damped'
                panel.plot(
                    made.run.time[::20], np.maximum(made.error('hand')[::20], 1e-9),
                    color=color(i), linestyle=dash(j), label=f'η = {gain:g}, {name}',
                    linewidth=1.4 if j else 4.0, alpha=1.0 if j else 0.4,
                )  # fmt: skip
        panel.set(title=arm.upper(), xlabel='time [s]', yscale='log', ylim=(1e-8, 1.0))
    panels[0].set_ylabel('error norm [m, rad]')
    handles = panels[0].get_legend_handles_labels()
    figure.legend(*handles, loc='outside lower center', ncols=3)
    figure.suptitle('D: decay of the error; two joints (RR) cannot reach a pose of three rows')
    return figure


def schemes():
    """C1's second target, where both tasks cannot hold, under every scheme."""
    figure = Figure(figsize=(8.0, 3.8), layout='constrained')
    left, right = figure.subplots(1, 2)
    for i, scheme in enumerate(SOLVER_TYPES):
        made = simulate(
            'c1_algorithmic_singularity', 20.0, Goal(0.0, 'tip', [3.3, 1.0]), settle=False,
            solver__type=scheme,
        )  # fmt: skip
        for panel, task in ((left, 'tip'), (right, 'last_link')):
            panel.plot(
                made.run.time, np.maximum(made.error(task), 1e-9), color=color(i),
                linestyle=dash(i), label=scheme, linewidth=4.5 - 0.7 * i,
            )  # fmt: skip
    left.set(title='first task: tip', ylabel='error norm [m]', yscale='log', ylim=(1e-7, 4.0))
    right.set(title='second task: last link', ylabel='error norm [rad]')
    for panel in (left, right):
        panel.set_xlabel('time [s]')
    figure.legend(*left.get_legend_handles_labels(), loc='outside lower center', ncols=3)
    figure.suptitle('Schemes side by side, where both tasks cannot hold')
    return figure


def limits():
    """Errors of both levels at the velocity limits, under each way to keep them."""
    ways = {
        'uniform': {'solver__saturation': 'uniform'},
        'null_space': {'solver__saturation': 'null_space'},
        'hqp': {'solver__type': 'hqp'},
    }
    figure = Figure(figsize=(8.0, 3.4), layout='constrained')
    left, right = figure.subplots(1, 2)
    for i, (name, changes) in enumerate(ways.items()):
        made = simulate(
            'a4_position_joint', 8.0, Goal(0.0, 'ee_position', [0.3, 1.2]),
            Goal(0.0, 'joint_1_position', [0.8]), tasks__joint_1_position__gain=[8.0],
            robot__limits__velocity=[0.4], **changes,
        )  # fmt: skip
        look = {'color': color(i), 'linestyle': dash(i), 'label': name}
        left.plot(made.run.time, made.error('ee_position'), **look)
        right.plot(made.run.time, made.error('joint_1_position'), **look)
    left.set(title='level 0: ee_position', xlabel='time [s]', ylabel='error norm [m]')
    right.set(title='level 1: joint 1, gain 8', xlabel='time [s]', ylabel='error norm [rad]')
    right.legend(loc='upper right')
    figure.suptitle('Priorities at the velocity limits (0.4 rad/s)')
    return figure


PICTURES = {
    function.__name__: function
    for function in (a1, a2, a3, a4, a5, b1, b2, c1, c2, c3, d, schemes, limits)
}


def draw(name):
    """Draw one of them."""
    with styled():
        return PICTURES[name]()
