import numpy as np, time, math
from numba import njit

FL = dict(error_model="numpy", fastmath={"contract", "reassoc", "nsz"})


def bench(f, *a):
    f(3, *a)
    best = 9
    for _ in range(5):
        t = time.process_time()
        f(20000, *a)
        best = min(best, time.process_time() - t)
    return round(best / 20000 * 1e9, 1)


rng = np.random.default_rng(0)
ser = rng.normal(size=(30, 40))
w = np.zeros(40)
worst = np.zeros(40)


@njit(**FL)
def p1(N, x):
    a = 0.0
    for i in range(N):
        a += (x + i) ** (-1 / 28)
    return a


@njit(**FL)
def a1(N, ser, w, worst, length, n):
    a = 0.0
    for _ in range(N):
        for k in range(8):
            worst[k] = 1e-300
        for start in range(0, length, n):
            for i in range(start, start + n):
                w[i] = 1.0 / (1e-12 + 1e-10 * abs(ser[0, i]))
            for k in range(8):
                t = ser[21 + k]
                g = worst[k]
                for i in range(start, start + n):
                    g = max(g, w[i] * abs(t[i]))
                worst[k] = g
        a += worst[7]
    return a


@njit(**FL)
def a2(N, ser, w, worst, length, n):
    a = 0.0
    for _ in range(N):
        for i in range(length):
            w[i] = 1.0 / (1e-12 + 1e-10 * abs(ser[0, i]))
        for k in range(8):
            t = ser[21 + k]
            g = 0.0
            for i in range(length):
                g += w[i] * abs(t[i])
            worst[k] = g
        a += worst[7]
    return a


@njit(**FL)
def a3(N, ser, w, worst, length, n):
    a = 0.0
    for _ in range(N):
        for i in range(length):
            w[i] = 1.0 / (1e-12 + 1e-10 * abs(ser[0, i]))
        w0 = 0.0
        w1 = 0.0
        w2 = 0.0
        w3 = 0.0
        w4 = 0.0
        w5 = 0.0
        w6 = 0.0
        w7 = 0.0
        for i in range(length):
            g = w[i]
            w0 = max(w0, g * abs(ser[21, i]))
            w1 = max(w1, g * abs(ser[22, i]))
            w2 = max(w2, g * abs(ser[23, i]))
            w3 = max(w3, g * abs(ser[24, i]))
            w4 = max(w4, g * abs(ser[25, i]))
            w5 = max(w5, g * abs(ser[26, i]))
            w6 = max(w6, g * abs(ser[27, i]))
            w7 = max(w7, g * abs(ser[28, i]))
        a += w0 + w1 + w2 + w3 + w4 + w5 + w6 + w7
    return a


@njit(**FL)
def lg(N, x):
    a = 0
    for i in range(N):
        a += math.frexp(x + i)[1]
    return a


print("pow", bench(p1, 1.0), "frexp", bench(lg, 1.0))
for L in (4, 8, 20):
    print(
        L,
        "a1",
        bench(a1, ser, w, worst, L, 4),
        "a2",
        bench(a2, ser, w, worst, L, 4),
        "a3",
        bench(a3, ser, w, worst, L, 4),
    )
