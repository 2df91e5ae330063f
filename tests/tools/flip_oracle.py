"""FLIP for LDR and HDR images in numpy, written from the papers alone, to test the command's own against.

[Andersson et al. 2020, FLIP: A Difference Evaluator for Alternating Images; 2021, Visualizing Errors in Rendered High
Dynamic Range Images]
"""
import numpy as np

PIXELS_PER_DEGREE = 0.7 * 3840 / 0.7 * np.pi / 180
RGB_TO_XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])
WHITE = RGB_TO_XYZ.sum(1)


def ycxcz(rgb):
    x, y, z = np.moveaxis(rgb @ RGB_TO_XYZ.T / WHITE, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], -1)


def rgb_of(opponent):
    y = (opponent[..., 0] + 16) / 116
    xyz = np.stack([y + opponent[..., 1] / 500, y, y - opponent[..., 2] / 200], -1) * WHITE
    return xyz @ np.linalg.inv(RGB_TO_XYZ).T


def lab(rgb):
    t = rgb @ RGB_TO_XYZ.T / WHITE
    x, y, z = np.moveaxis(np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], -1)


def hunt(l):
    return np.stack([l[..., 0], 0.01 * l[..., 0] * l[..., 1], 0.01 * l[..., 0] * l[..., 2]], -1)


def convolve(plane, kernel):
    r = kernel.shape[0] // 2
    padded = np.pad(plane, r, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, kernel.shape)
    return np.einsum("ijkl,kl->ij", windows, kernel)


def grid(radius):
    return np.meshgrid(np.arange(-radius, radius + 1), np.arange(-radius, radius + 1))


def colours(opponent, ppd):
    sensitivity = [(1, 0.0047, 0, 1e-5), (1, 0.0053, 0, 1e-5), (34.1, 0.04, 13.5, 0.025)]
    radius = int(np.ceil(3 * np.sqrt(0.04 / (2 * np.pi ** 2)) * ppd))
    x, y = grid(radius)
    d2 = (x / ppd) ** 2 + (y / ppd) ** 2
    planes = []
    for c, (a1, b1, a2, b2) in enumerate(sensitivity):
        kernel = sum(a * np.sqrt(np.pi / b) * np.exp(-np.pi ** 2 * d2 / b) for a, b in ((a1, b1), (a2, b2)))
        planes.append(convolve(opponent[..., c], kernel / kernel.sum()))
    return hunt(lab(np.clip(rgb_of(np.stack(planes, -1)), 0, 1)))


def features(opponent, ppd):
    sd = 0.5 * 0.082 * ppd
    x, y = grid(int(np.ceil(3 * sd)))
    g = np.exp(-(x ** 2 + y ** 2) / (2 * sd ** 2))
    luminance = (opponent[..., 0] + 16) / 116
    strengths = []
    for kernel in (-x * g, (x ** 2 / sd ** 2 - 1) * g):
        kernel = np.where(kernel > 0, kernel / kernel[kernel > 0].sum(), kernel / -kernel[kernel < 0].sum())
        strengths.append(np.hypot(convolve(luminance, kernel), convolve(luminance, kernel.T)))
    return strengths


def hyab(a, b):
    return np.abs(a[..., 0] - b[..., 0]) + np.hypot(a[..., 1] - b[..., 1], a[..., 2] - b[..., 2])


def ldr(image, reference, ppd=PIXELS_PER_DEGREE):
    """Of linear RGB in [0, 1]."""
    a, b = ycxcz(image), ycxcz(reference)
    power = hyab(colours(a, ppd), colours(b, ppd)) ** 0.7
    greatest = hyab(hunt(lab(np.array([0.0, 1, 0]))), hunt(lab(np.array([0.0, 0, 1])))) ** 0.7
    colour = np.where(power < 0.4 * greatest, 0.95 / (0.4 * greatest) * power,
                      0.95 + (power - 0.4 * greatest) / (0.6 * greatest) * 0.05)
    feature = np.maximum(*(np.abs(p - q) for p, q in zip(features(a, ppd), features(b, ppd))))
    return np.clip(colour ** (1 - np.sqrt(np.clip(feature / np.sqrt(2), 0, 1))), 0, 1)


def hdr(image, reference, ppd=PIXELS_PER_DEGREE):
    """(error of each pixel, number of exposures) of radiance."""
    k = [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14]

    def curve(x):
        return np.clip((k[0] * x ** 2 + k[1] * x + k[2]) / (k[3] * x ** 2 + k[4] * x + k[5]), 0, 1)

    bright = max(np.roots([k[i] - 0.85 * k[i + 3] for i in range(3)]))
    y = reference @ np.array([0.2126, 0.7152, 0.0722])
    start, stop = np.log2(bright / y.max()), np.log2(bright / np.median(y))
    exposures = np.linspace(start, stop, max(2, int(np.ceil(stop - start))))
    errors = [ldr(curve(image * 2 ** e), curve(reference * 2 ** e), ppd) for e in exposures]
    return np.max(errors, 0), len(exposures)
