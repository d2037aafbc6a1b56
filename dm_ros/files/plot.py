# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A picture of a recorded run: speeds, moments, torques and power flow over time."""

PANELS = (   # kind of column, what it is called, unit
    ('velocity', 'speed', 'rad/s'),
    ('moment', 'internal moment', 'N m'),
    ('torque', 'torque', 'N m'),
    ('clutch_force', 'clutch force', 'N'),   # only where there is any
)
HELD = 'torque', 'clutch force', 'power flow'
FAST = ('pinion', 'satellite')   # they turn several times as fast: a panel of their own
COLORS = {   # a shaft has one colour in all panels, and its moment as well
    'carrier': '#222222', 'pinion': '#2a8a3e', 'satellite': '#b8860b',
    'left': '#1f6fb5', 'right': '#d1441f', 'front': '#1f6fb5', 'rear': '#d1441f',
    'final_drive': '#222222', 'left_mesh': '#1f6fb5', 'right_mesh': '#d1441f',
    'front_mesh': '#1f6fb5', 'rear_mesh': '#d1441f',
    'front_clutch': '#8ab8de', 'rear_clutch': '#eda58f',
    'left_clutch': '#8ab8de', 'right_clutch': '#eda58f',
}

# a legend beside its panel, where it hides no curve
BESIDE = {'loc': 'upper left', 'bbox_to_anchor': (1.0, 1.02), 'frameon': False}


def require_matplotlib():
    """Raise ValueError where matplotlib is missing; only pictures need it."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        raise ValueError('a picture needs matplotlib: pip install "dm_ros[plot]", '
                         'or apt install python3-matplotlib') from None


def save_plot(columns, file, title):
    """
    Draw a record as PNG.

    :param columns: mapping from the names of ``OUT.csv`` to arrays of one length; a structured
        array will do as well.
    :param file: a path or a binary file.
    :param title: what stands above, such as the variant.
    :raises ValueError: where matplotlib is missing.
    """
    require_matplotlib()
    # the objects of a figure, not pyplot: no display, and nothing is left behind
    from matplotlib.figure import Figure

    columns = dict(columns) if hasattr(columns, 'keys') else {
        name: columns[name] for name in columns.dtype.names}
    panels = list(_panels(columns))
    figure = Figure(figsize=(10, 2.0 * len(panels) + 1.2), dpi=120, layout='constrained')
    figure.suptitle(title, fontweight='bold')
    heights = [0.6 if label == 'power flow' else 2.0 for label, _ in panels]
    axes = figure.subplots(len(panels), sharex=True, height_ratios=heights, squeeze=False)[:, 0]
    for ax, (label, curves) in zip(axes, panels, strict=True):
        _draw(ax, columns['time'], label, curves)
    axes[-1].set_xlabel('time, s')
    axes[-1].set_xlim(columns['time'][0], columns['time'][-1])
    figure.align_ylabels(axes)
    figure.savefig(file, format='png')


def _panels(columns):
    """Yield (label, {name: values}) for each panel."""
    for kind, title, unit in PANELS:
        curves = {name.removeprefix(kind + '.'): values for name, values in columns.items()
                  if name.startswith(kind + '.')}
        if kind == 'velocity':
            fast = {name: curves.pop(name) for name in FAST if name in curves}
            yield f'{title}, {unit}', curves
            curves = fast
        if kind != 'clutch_force' or any(values.any() for values in curves.values()):
            yield f'{title}, {unit}', curves
    yield 'power flow', {'power_flow': columns['power_flow']}


def _draw(ax, time, label, curves):
    ax.set_ylabel(label)
    ax.grid(alpha=0.25)
    ax.spines[['top', 'right']].set_visible(False)
    held = label.startswith(HELD)   # from the preceding row's time on
    for name, values in curves.items():
        if held:
            ax.step(time, values, where='pre', color=COLORS.get(name), linewidth=1.1, label=name)
        else:
            ax.plot(time, values, color=COLORS.get(name), linewidth=1.1, label=name)
    if label == 'power flow':
        ax.set_ylim(-1.5, 1.5)
        ax.set_yticks([-1, 1], ['reverse', 'direct'])
        ax.fill_between(time, -1.5, 1.5, where=curves['power_flow'] < 0, step='pre',
                        color='#d1441f', alpha=0.12, linewidth=0)
    else:
        ax.legend(**BESIDE)
        ax.axhline(0.0, color='0.6', linewidth=0.6, zorder=0)
