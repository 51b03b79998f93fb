#!/usr/bin/env python3
"""Makes src/experiment/stress/digits.rs: closed forms of the models to fifty digits, rounded to double precision.

Needs mpmath (any version since 1.2). Inputs are exactly the doubles (or singles) that the table shows.
Run from the project's folder: python3 tools/digits.py > src/experiment/stress/digits.rs
"""

import struct

from mpmath import besseli, erf, exp, expm1, inf, lambertw, log1p, mp, mpf, nsum, pi, sin, cos, sinh, sqrt

mp.dps = 50

LOSSES = [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.03, 0.2, 0.5, 0.9, 0.999999]
COUNTS = [1e-3, 0.3, 1.0, 1.5, 4.0, 30.25, 1e3, 1e4]


def single(x):
    return struct.unpack("f", struct.pack("f", x))[0]


def passed(loss, n):
    return (1 - loss) ** n


def once_back(loss, n):
    x = -log1p(-loss)
    return n if loss == 0 else expm1(-2 * n * x) / expm1(-2 * x)


def thrice_back(loss, n):
    if n <= 1:
        return mpf(0)
    if loss == 0:
        return n * (n - 1) * (2 * n - 1) / 6
    x, m = -log1p(-loss), 2 * n - 1
    with mp.workdps(160):
        return exp(-2 * (n - 1) * x) * (sinh(m * x) - m * sinh(x)) / (4 * sinh(x) ** 3)


def mean_steps(loss, n):
    if n <= 1:
        return mpf(0)
    if loss == 0:
        return (n - 1) / 2
    y = -2 * log1p(-loss)
    with mp.workdps(120):
        return 1 / expm1(y) - n / expm1(n * y)


def poisson_passed(loss, n):
    return exp(-n * loss)


def poisson_once_back(loss, n):
    e = loss * (2 - loss)
    return n if loss == 0 else -expm1(-n * e) / e


def poisson_thrice_back(loss, n):
    if loss == 0:
        # E[N (N - 1) (2 N - 1) / 6]
        return n**3 / 3 + n**2 / 2
    with mp.workdps(160):
        q = (1 - loss) ** 2
        e = 1 - q
        return (q - exp(-n * (1 - q**2)) - (2 * n * q - 1) * e * exp(-n * e)) / e**3


def two_stream(absorbed, back, n):
    k = absorbed + back
    g = sqrt(absorbed * (k + back))
    if g == 0:
        return back * n / (1 + back * n), 1 / (1 + back * n)
    s = -expm1(-2 * g * n) / (2 * g)
    den = k * s + (1 + exp(-2 * g * n)) / 2
    return back * s / den, exp(-g * n) / den


def rate(loss, density):
    if loss == 0:
        return mpf(0)
    b = density / (1 - density)
    with mp.workdps(120):
        return ((b - lambertw((1 - loss) * b * exp(b))) / density).real


def kernel(kappa, si, ci, so, co):
    # exp(-kappa s_i s_o) sinh(kappa c_i c_o) / (kappa c_i c_o) written so that it is exact for rounded sines.
    x = kappa * ci * co
    spread = -expm1(-2 * x) / (2 * x) if x > 0 else mpf(1)
    norm = kappa / (pi * besseli(1, kappa) * exp(-kappa)) if kappa > 0 else 2 / pi
    return norm * exp(-kappa / 2 * ((ci - co) ** 2 + (si + so) ** 2)) * spread


def front_share(sigma):
    # P(|wrapped normal| < pi / 2), by its Fourier series or its images, whichever converges.
    if sigma > 1:
        terms = nsum(lambda m: sin(m * pi / 2) / m * exp(-(m**2) * sigma**2 / 2), [1, inf], method="d")
        return mpf(1) / 2 + 2 / pi * terms
    s = sigma * sqrt(2)
    return sum((erf((pi / 2 + 2 * pi * k) / s) - erf((-pi / 2 + 2 * pi * k) / s)) / 2 for k in range(-3, 4))


def wrapped(d, sigma):
    images = range(-int(8 * sigma / 6) - 3, int(8 * sigma / 6) + 4)
    return sum(exp(-((d + 2 * pi * k) ** 2) / (2 * sigma**2)) for k in images) / (sigma * sqrt(2 * pi))


def f64(x):
    x = float(x)
    return repr(x) if "e" in repr(x) or "." in repr(x) else repr(x) + ".0"


def table(name, doc, width, rows):
    print(f"\n/// {doc}")
    print(f"pub(super) const {name}: [[f64; {width}]; {len(rows)}] = [")
    for row in rows:
        print("    [" + ", ".join(f64(v) for v in row) + "],")
    print("];")


print("//! Closed forms of the models, computed with fifty digits and rounded to double precision.")
print("//!")
print("//! Made by `tools/digits.py` with mpmath; do not edit by hand.")
print()
print('#![allow(clippy::excessive_precision, clippy::approx_constant, reason = "numbers as they were computed")]')
print("#![cfg_attr(rustfmt, rustfmt_skip)]")

rows = []
for loss in LOSSES:
    for n in COUNTS:
        L, N = mpf(loss), mpf(n)
        rows.append([loss, n, passed(L, N), once_back(L, N), thrice_back(L, N), mean_steps(L, N),
                     poisson_passed(L, N), poisson_once_back(L, N), poisson_thrice_back(L, N)])
table("STACKS", "loss, n, then: passed, once back, thrice back, mean steps, and the Poisson means of the first three.", 9, rows)

rows = []
for absorbed, back in [(0.0, 1e-8), (0.0, 0.5), (1e-12, 0.3), (1e-6, 1e-6), (0.01, 0.2), (0.5, 0.5), (1.0, 0.0)]:
    for n in [1e-3, 1.0, 30.25, 1e3]:
        r, t = two_stream(mpf(absorbed), mpf(back), mpf(n))
        rows.append([absorbed, back, n, r, t])
table("TWO_STREAMS", "absorbed, back, n, then: reflected, transmitted.", 5, rows)

rows = []
for density in [1e-5, 1e-3, 0.1, 0.5, 0.85]:
    for loss in [1e-15, 1e-9, 1e-3, 0.3, 0.5, 0.7, 0.999999]:
        rows.append([loss, density, rate(mpf(loss), mpf(density))])
table("RATES", "loss, density, then: the effective extinction rate.", 3, rows)

rows = []
for beta in [1e-4, 1e-3, 0.01, 0.15, 0.5, 1.5, 3.2, 10.0]:
    kappa = single(0.25 / (beta * beta))
    for ti in [0.0, 0.7, -1.3, 1.5707]:
        for offset in [0.0, 1.0, -2.0]:
            to = max(-1.5707, min(1.5707, -ti + offset * 2 * min(beta, 1.0)))
            args = [single(f) for f in (float(sin(ti)), float(cos(ti)), float(sin(to)), float(cos(to)))]
            rows.append([kappa, *args, kernel(mpf(kappa), *map(mpf, args))])
table("KERNELS", "kappa, sine and cosine of both latitudes (single precision, taken as exact), then: M.", 6, rows)

rows = []
for sigma in [1e-5, 0.01, 0.1, 0.35, 0.8, 1.5, 2.49, 2.51, 3.99, 4.01, 10.0]:
    for d in [0.0, 0.5, 1.5, 3.0]:
        s, x = single(sigma), single(d)
        rows.append([x, s, wrapped(mpf(x), mpf(s)), front_share(mpf(s))])
table("WRAPPED", "distance, sigma (single precision), then: wrapped normal density, share within a quarter turn.", 4, rows)

rows = [[x, besseli(1, mpf(x)) * exp(-mpf(x))] for x in [1e-8, 1e-3, 0.5, 3.0, 19.999, 20.001, 35.0, 1e3, 1e6, 1e9]]
table("BESSEL", "x, then: e^-x I1(x).", 2, rows)
