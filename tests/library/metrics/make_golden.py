"""Writes golden.json: small seeded image pairs and their metrics.

The metrics are computed by numpy, scikit-image and the authors' FLIP.

The Rust tests read only golden.json; run this script again to change the images:

    pip install numpy scikit-image flip-evaluator
    python tests/library/metrics/make_golden.py

Pixels are whole multiples of 1/1024, so that they are exact in 32-bit floats and short in JSON.
"""

import json
import math
from importlib.metadata import version
from pathlib import Path

import flip_evaluator
import numpy as np
import skimage
from skimage.metrics import structural_similarity

STEPS = 1024
WIDTH, HEIGHT = 24, 20


def quantise(image):
    return np.rint(image * STEPS).astype(np.int64)


def smooth(rng):
    """Returns a soft gradient with a hard edge, a dark corner and some texture, in 0..1."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] / [[[HEIGHT]], [[WIDTH]]]
    base = 0.15 + 0.5 * x + 0.25 * np.sin(7.0 * y)
    base = np.where((x > 0.55) & (y > 0.4), 0.85 - base, base)
    tint = rng.uniform(0.6, 1.0, 3)
    image = base[..., None] * tint + rng.normal(0.0, 0.02, (HEIGHT, WIDTH, 3))
    image[:6, :6] *= 0.01
    return np.clip(image, 0.0, 1.0)


def ldr_pair(rng):
    reference = smooth(rng)
    return np.clip(reference + rng.normal(0.0, 0.06, reference.shape), 0.0, 1.0), reference


def hdr_pair(rng):
    """Returns radiance up to about 50 with a light, and noise with a few bright outliers.

    The noise is multiplicative.
    """
    reference = 4.0 * smooth(rng) ** 2
    reference[2:5, 10:14] = [45.0, 38.0, 26.0]
    image = reference * rng.gamma(4.0, 0.25, reference.shape)
    image[rng.integers(0, HEIGHT, 5), rng.integers(0, WIDTH, 5)] += 20.0
    return image, reference


def blurred_pair(rng):
    """Returns an image with the same mean and less structure."""
    reference = smooth(rng)
    padded = np.pad(reference, ((1, 1), (1, 1), (0, 0)), mode="edge")
    shifts = [padded[i : i + HEIGHT, j : j + WIDTH] for i in range(3) for j in range(3)]
    return np.mean(shifts, axis=0), reference


def srgb(x):
    x = np.clip(x, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(x, 1.0 / 2.4) - 0.055)


def reinhard(x, exposure, gamma):
    x = np.maximum(x, 0.0) * 2.0**exposure
    return np.power(x / (1.0 + x), 1.0 / gamma)


def ssim(image, reference, data_range, **window):
    return float(
        structural_similarity(image, reference, data_range=data_range, channel_axis=2, **window)
    )


UNIFORM = dict(gaussian_weights=False, win_size=7, use_sample_covariance=True)
GAUSS = dict(gaussian_weights=True, sigma=1.5, use_sample_covariance=False)


def flip(image, reference, range_, srgb_values=False, **parameters):
    """Returns the authors' map, mean and parameters; images are linear unless `srgb_values`."""
    image, reference = (np.ascontiguousarray(i, dtype=np.float32) for i in (image, reference))
    return flip_evaluator.evaluate(
        reference, image, range_, inputsRGB=srgb_values, applyMagma=False, parameters=parameters
    )


def flips(image, reference):
    def shown(i):
        return np.clip(i, 0.0, 1.0)

    ldr, ldr_mean, _ = flip(shown(image), shown(reference), "LDR")
    hdr, hdr_mean, settled = flip(image, reference, "HDR")
    hable = dict(tonemapper="hable", startExposure=-3.0, stopExposure=2.0, numExposures=4, ppd=30.0)
    return {
        "flip": ldr_mean,
        "flip_map": np.round(ldr.astype(np.float64).ravel(), 7).tolist(),
        "flip_ppd_20": flip(shown(image), shown(reference), "LDR", ppd=20.0)[1],
        "flip_ppd_150": flip(shown(image), shown(reference), "LDR", ppd=150.0)[1],
        "flip_on_srgb": flip(srgb(0.5 * image), srgb(0.5 * reference), "LDR", srgb_values=True)[1],
        "hdr_flip": hdr_mean,
        "hdr_flip_map": np.round(hdr.astype(np.float64).ravel(), 7).tolist(),
        "hdr_flip_start": settled["startExposure"],
        "hdr_flip_stop": settled["stopExposure"],
        "hdr_flip_exposures": settled["numExposures"],
        "hdr_flip_reinhard": flip(image, reference, "HDR", tonemapper="reinhard")[1],
        "hdr_flip_hable": flip(image, reference, "HDR", **hable)[1],
    }


PATCHES = (150, 101)


def pcg4d(x, y, z, w):
    """Returns two of the four hashed words of arrays of 32-bit words, as `math/rng.rs` does."""
    v = [np.asarray(a, dtype=np.uint32) * np.uint32(1664525) for a in np.broadcast_arrays(x, y, z, w)]
    x, y, z, w = (a + np.uint32(1013904223) for a in v)

    def mix(x, y, z, w):
        x = x + y * w
        y = y + z * x
        z = z + x * y
        return x, y, z, w + y * z

    x, y, z, w = (a ^ (a >> np.uint32(16)) for a in mix(x, y, z, w))
    return mix(x, y, z, w)[:2]


def patches(seed, noise):
    """Returns sRGB bytes, patches of several sizes and noise, as `picture` of oracle.rs does."""
    width, height = PATCHES
    y, x, c = np.meshgrid(np.arange(height), np.arange(width), np.arange(3), indexing="ij")

    def unit(word):
        return (word >> np.uint32(8)).astype(np.float32) * np.float32(1.0 / 16777216.0)

    value = np.zeros(x.shape, dtype=np.float32)
    for weight, side in [(0.5, 31), (0.35, 7), (0.15, 2)]:
        value += np.float32(weight) * unit(pcg4d(x // side, y // side, c, side)[0])
    value += np.float32(noise) * (unit(pcg4d(x, y, c, seed)[1]) - np.float32(0.5))
    return np.floor(np.float32(255.0) * np.clip(value, 0.0, 1.0) + np.float32(0.5)).astype(np.uint8)


def flips_of_patches():
    """Returns the authors' means, and every 97th value of their maps, at several distances."""
    reference = patches(1, 0.05)
    rows = []
    for noise, ppd in [(0.1, 67.0206), (0.6, 67.0206), (0.6, 25.0), (2.0, 110.0)]:
        image = patches(2, noise)
        errors, mean, _ = flip(image / 255.0, reference / 255.0, "LDR", srgb_values=True, ppd=ppd)
        rows.append(
            {
                "noise": noise,
                "ppd": ppd,
                "pixels_sum": int(image.sum()) + int(reference.sum()),
                "mean": mean,
                "map": np.round(errors.astype(np.float64).ravel()[::97], 7).tolist(),
            }
        )
    return rows


def bias_se(difference, side):
    """Returns the standard error of the mean from the sums of square blocks."""
    pixels = difference.mean(axis=2)
    blocks = [
        (pixels[y : y + side, x : x + side].sum(), pixels[y : y + side, x : x + side].size)
        for y in range(0, HEIGHT, side)
        for x in range(0, WIDTH, side)
    ]
    scatter = sum((total - count * pixels.mean()) ** 2 for total, count in blocks)
    return math.sqrt(len(blocks) / (len(blocks) - 1) * scatter) / pixels.size


def fireflies(image, reference, deviations, excess):
    weights = np.array([0.2126, 0.7152, 0.0722])
    light, truth = image @ weights, reference @ weights
    e = (light - truth) / (truth + 0.1 * truth.mean())
    spread = 1.4826 * np.median(np.abs(e - np.median(e)))
    return int(np.sum(e > max(np.median(e) + deviations * spread, excess)))


def relmse_trimmed(image, reference, worst):
    """Returns the mean relative squared error without a fraction of the worst pixels."""
    errors = np.sort(((image - reference) ** 2 / (reference**2 + 0.01)).mean(axis=2).ravel())
    return float(np.mean(errors[: errors.size - int(worst * errors.size)]))


def expected(image, reference, data_range):
    difference = image - reference
    mse = float(np.mean(difference**2))
    tone = lambda x: reinhard(x, 0.5, 2.2)
    return {
        "mse": mse,
        "rmse": math.sqrt(mse),
        "mae": float(np.mean(np.abs(difference))),
        "relmse": float(np.mean(difference**2 / (reference**2 + 0.01))),
        "relmse_eps_1": float(np.mean(difference**2 / (reference**2 + 1.0))),
        "relmse_trimmed": relmse_trimmed(image, reference, 0.001),
        "relmse_trimmed_percent": relmse_trimmed(image, reference, 0.01),
        "relmse_trimmed_half": relmse_trimmed(image, reference, 0.5),
        "mape": float(np.mean(np.abs(difference) / (np.abs(reference) + 0.01))),
        "mape_eps_1": float(np.mean(np.abs(difference) / (np.abs(reference) + 1.0))),
        "smape": float(
            np.mean(np.abs(difference) / (np.abs(image) + np.abs(reference) + 0.01))
        ),
        "psnr": 10.0 * math.log10(data_range**2 / mse),
        "ssim_uniform": ssim(image, reference, data_range, **UNIFORM),
        "ssim_gauss": ssim(image, reference, data_range, **GAUSS),
        "bias": float(np.mean(difference)),
        "bias_se": bias_se(difference, 8),
        "bias_se_block_3": bias_se(difference, 3),
        "fireflies": fireflies(image, reference, 10.0, 1.0),
        "fireflies_dim": fireflies(image, reference, 1.0, 0.1),
        "mse_on_srgb": float(np.mean((srgb(image) - srgb(reference)) ** 2)),
        "ssim_uniform_on_reinhard": ssim(tone(image), tone(reference), 1.0, **UNIFORM),
        "ssim_gauss_on_reinhard": ssim(tone(image), tone(reference), 1.0, **GAUSS),
        **flips(image, reference),
    }


def main():
    pairs = []
    for name, seed, data_range, make in [
        ("ldr", 11, 1.0, ldr_pair),
        ("hdr", 12, 45.0, hdr_pair),
        ("blurred", 13, 1.0, blurred_pair),
    ]:
        image, reference = (quantise(i) for i in make(np.random.default_rng(seed)))
        pairs.append(
            {
                "name": name,
                "range": data_range,
                "image": image.ravel().tolist(),
                "reference": reference.ravel().tolist(),
                "expected": expected(image / STEPS, reference / STEPS, data_range),
            }
        )
    golden = {
        "made_by": f"make_golden.py with numpy {np.__version__}, "
        f"scikit-image {skimage.__version__}, "
        f"flip-evaluator {version('flip-evaluator')}",
        "width": WIDTH,
        "height": HEIGHT,
        "steps": STEPS,
        "pairs": pairs,
        "patches": flips_of_patches(),
    }
    path = Path(__file__).with_name("golden.json")
    text = json.dumps(golden, separators=(",", ":")).replace('{"name"', '\n{"name"')
    text = text.replace('"patches"', '\n"patches"')
    path.write_text(text + "\n")


if __name__ == "__main__":
    main()
