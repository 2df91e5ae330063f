"""Curves on logarithmic axes as an SVG file; each series has a marker of its own, so it reads without colour."""
import html
import math
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "export_scripts/scenes"))
import whole_file  # noqa: E402

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 640, 400, 64, 20, 34, 50
COLOURS = ("#1b6ca8", "#c0392b", "#2e8b57", "#8e44ad", "#b9770e")
MARKERS = ("M-4,-4h8v8h-8z", "M0,-5L5,4H-5z", "M-5,0L0,-5L5,0L0,5z", "M-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0", "M-5,-4H5L0,5z")


def _ticks(low, high):
    steps = (1, 2, 5) if high / low < 2000 else (1,)
    return [t for e in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1) for t in
            (s * 10.0 ** e for s in steps) if low * 0.999 <= t <= high * 1.001]


def _text(value, percent):
    return f"{100 * value:g}%" if percent else f"{value:g}"


def write(path, title, x_label, y_label, series, percent=True, slope=None):
    """`series`: [(name, [(x, y), ...]), ...], all above 0. `slope`: a dashed guide y ~ x^slope through the first point."""
    points = [p for _, curve in series for p in curve]
    if not points or min(min(p) for p in points) <= 0:
        raise ValueError(f"{path}: values must be above 0")

    def limits(values):
        low, high = min(values), max(values)
        return low / 1.25, high * 1.25

    (x0, x1), (y0, y1) = limits([p[0] for p in points]), limits([p[1] for p in points])

    def place(x, y):
        return (LEFT + (WIDTH - LEFT - RIGHT) * math.log(x / x0) / math.log(x1 / x0),
                HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * math.log(y / y0) / math.log(y1 / y0))

    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="12">',
           f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
           f'<text x="{WIDTH / 2}" y="20" text-anchor="middle" font-size="14">{html.escape(title)}</text>',
           f'<text x="{(WIDTH + LEFT) / 2}" y="{HEIGHT - 10}" text-anchor="middle">{html.escape(x_label)}</text>',
           f'<text transform="translate(14,{HEIGHT / 2}) rotate(-90)" text-anchor="middle">{html.escape(y_label)}</text>']
    for t in _ticks(x0, x1):
        x = place(t, y0)[0]
        out.append(f'<path d="M{x:.1f},{TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>'
                   f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{_text(t, False)}</text>')
    for t in _ticks(y0, y1):
        y = place(x0, t)[1]
        out.append(f'<path d="M{LEFT},{y:.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
                   f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{_text(t, percent)}</text>')
    if slope is not None:
        x, y = series[0][1][0]
        end = x1 if y * (x1 / x) ** slope > y0 else x * (y0 / y) ** (1 / slope)
        (ax, ay), (bx, by) = place(x, y), place(end, y * (end / x) ** slope)
        out.append(f'<path d="M{ax:.1f},{ay:.1f}L{bx:.1f},{by:.1f}" stroke="#888" stroke-dasharray="5,4" fill="none"/>')
    for i, (name, curve) in enumerate(series):
        colour, marker = COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)]
        at = [place(*p) for p in sorted(curve)]
        out.append('<path d="M' + "L".join(f"{x:.1f},{y:.1f}" for x, y in at) + f'" stroke="{colour}" fill="none" stroke-width="1.5"/>')
        out += [f'<path transform="translate({x:.1f},{y:.1f})" d="{marker}" fill="{colour}"/>' for x, y in at]
        y = TOP + 18 + 18 * i
        out.append(f'<path transform="translate({WIDTH - RIGHT - 12},{y - 4})" d="{marker}" fill="{colour}"/>'
                   f'<text x="{WIDTH - RIGHT - 22}" y="{y}" text-anchor="end">{html.escape(name)}</text>')
    whole_file.write(path, "\n".join(out) + "\n</svg>\n")
