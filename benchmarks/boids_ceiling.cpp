// Reference for the speed of boids in 3D in optimised C++; benchmarks/boids.py compares the model "boids" with it.
// Grid (cube = range) sorted in each tick, float32 arrays per component, contiguous candidates, plain loops that the
// compiler vectorises, OpenMP.
// The same work: neighbours in range and in a cone of 300 degrees; separation, matching, centring (inverse square, more
// ahead than behind), level flight; prioritised allocation; speed limits, damping; the frame turned without roll and
// banked; a box periodic in x and y.
// Build: g++ -O3 -march=native -ffast-math -fopenmp -std=c++17 boids_ceiling.cpp -o boids_ceiling
// Use:   OMP_NUM_THREADS=2 ./boids_ceiling start.bin ticks     (start.bin: int64 n, float64 side, range, separation; then
//        float32 position (n,3), velocity (n,3)); prints one line of JSON
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>
#include <omp.h>
#include <sys/resource.h>
using std::vector;
static const float DT = 1 / 32.f, OWN = .2f, TOP = 80, LEAST = 10, MOST = 160, DAMPING = 1, CRUISE = 45, MATCH = .15f, ROLL = .25f, G9 = 9.81f;
static const float STRENGTH[] = {1, .8f, 1, .3f};
static int N; static float L, R, SEP;
struct State { vector<float> x, y, z, vx, vy, vz, ux, uy, uz; vector<int> id;
    void size(int n) { for (auto a : {&x, &y, &z, &vx, &vy, &vz, &ux, &uy, &uz}) a->resize(n + 16); id.resize(n + 16); } };
static State A, B;                       // A: at the start of the tick; B: sorted, with ghosts beyond the border
static vector<int> start_, where_, ghost_;
static double NB;

static void tick(bool count) {
    // ghosts across the seams, then a counting sort
    static vector<float> gx, gy; static vector<int> of;
    gx.clear(); gy.clear(); of.clear();
    for (int i = 0; i < N; i++) for (int a = -1; a <= 1; a++) for (int b = -1; b <= 1; b++) {
        float x = A.x[i] + a * L, y = A.y[i] + b * L;
        if ((a || b) && x > -R && x < L + R && y > -R && y < L + R) { gx.push_back(x); gy.push_back(y); of.push_back(i); }
    }
    int M = N + (int)of.size();
    float low = 1e30f, high = -1e30f;
    for (int i = 0; i < N; i++) { low = std::min(low, A.z[i]); high = std::max(high, A.z[i]); }
    int nx = (int)((L + 2 * R) / R) + 1, ny = nx, nz = (int)((high - low) / R) + 1, C = nx * ny * nz;
    start_.assign(C + 1, 0); where_.resize(M); ghost_.resize(M + 16); B.size(M);
    auto X = [&](int k) { return k < N ? A.x[k] : gx[k - N]; };
    auto Y = [&](int k) { return k < N ? A.y[k] : gy[k - N]; };
    for (int k = 0; k < M; k++) {
        int i = k < N ? k : of[k - N];
        int c = ((int)((A.z[i] - low) / R) * ny + (int)((Y(k) + R) / R)) * nx + (int)((X(k) + R) / R);
        where_[k] = c; start_[c + 1]++;
    }
    for (int c = 0; c < C; c++) start_[c + 1] += start_[c];
    vector<int> fill(start_.begin(), start_.end() - 1);
    for (int k = 0; k < M; k++) {
        int i = k < N ? k : of[k - N], s = fill[where_[k]]++;
        B.x[s] = X(k); B.y[s] = Y(k); B.z[s] = A.z[i]; B.vx[s] = A.vx[i]; B.vy[s] = A.vy[i]; B.vz[s] = A.vz[i];
        B.ux[s] = A.ux[i]; B.uy[s] = A.uy[i]; B.uz[s] = A.uz[i]; B.id[s] = i; ghost_[s] = k >= N;
    }
    double nb = 0;
    const float *bx = B.x.data(), *by = B.y.data(), *bz = B.z.data(), *bvx = B.vx.data(), *bvy = B.vy.data(), *bvz = B.vz.data();
#pragma omp parallel reduction(+:nb)
    {
        vector<float> lx, ly, lz, lu, lv, lw;                  // all animals in a cube and around it, contiguous
#pragma omp for schedule(dynamic, 16)
        for (int cube = 0; cube < C; cube++) {
            if (start_[cube] == start_[cube + 1]) continue;
            int ix = cube % nx, iy = cube / nx % ny, iz = cube / nx / ny, m = 0;
            if (!ix || !iy || ix == nx - 1 || iy == ny - 1) continue;              // ghosts only
            for (int k = std::max(iz - 1, 0); k <= std::min(iz + 1, nz - 1); k++) for (int j = iy - 1; j <= iy + 1; j++) {
                int row = (k * ny + j) * nx, a = start_[row + ix - 1], b = start_[row + ix + 2];
                if ((int)lx.size() < m + b - a) for (auto q : {&lx, &ly, &lz, &lu, &lv, &lw}) q->resize(2 * (m + b - a) + 64);
                for (int t = a; t < b; t++, m++) { lx[m] = bx[t]; ly[m] = by[t]; lz[m] = bz[t]; lu[m] = bvx[t]; lv[m] = bvy[t]; lw[m] = bvz[t]; }
            }
            const float *qx = lx.data(), *qy = ly.data(), *qz = lz.data(), *qu = lu.data(), *qv = lv.data(), *qw = lw.data();
            for (int s = start_[cube]; s < start_[cube + 1]; s++) {
                if (ghost_[s]) continue;
                float xi = bx[s], yi = by[s], zi = bz[s], vx = bvx[s] / OWN, vy = bvy[s] / OWN, vz = bvz[s] / OWN;
                float speed = std::sqrt(vx * vx + vy * vy + vz * vz), fx = vx / speed, fy = vy / speed, fz = vz / speed;
                float lean = std::min(speed / TOP, 1.f) * .5f, R2 = R * R, S2 = SEP * SEP, C2 = .75f;   // cos(150 degrees) squared
                float sx = 0, sy = 0, sz = 0, mx = 0, my = 0, mz = 0, cx = 0, cy = 0, cz = 0, total = 0, seen = 0;
#pragma omp simd reduction(+:sx,sy,sz,mx,my,mz,cx,cy,cz,total,seen)
                for (int j = 0; j < m; j++) {
                    float dx = qx[j] - xi, dy = qy[j] - yi, dz = qz[j] - zi, d2 = dx * dx + dy * dy + dz * dz;
                    float ahead = dx * fx + dy * fy + dz * fz;
                    bool in = d2 <= R2 && d2 > 0 && (ahead >= 0 || ahead * ahead <= C2 * d2);
                    float one = in ? OWN / std::sqrt(std::max(d2, 1e-12f)) : 0.f, w = std::min(one * one, 1 / .09f);
                    float x = dx / OWN, y = dy / OWN, z = dz / OWN;
                    float push = d2 < S2 ? std::max((S2 / (OWN * OWN) * w - 1), 0.f) * one : 0.f;
                    sx -= push * x; sy -= push * y; sz -= push * z;
                    w *= 1 + lean * (1 + ahead / OWN * one);
                    w = in ? w : 0.f;
                    total += w; seen += in ? 1.f : 0.f;
                    mx += w * qu[j]; my += w * qv[j]; mz += w * qw[j];
                    cx += w * x; cy += w * y; cz += w * z;
                }
                float ask[4][3] = {{sx, sy, sz}, {0, 0, 0}, {0, 0, 0}, {0, 0, std::min(std::max(-vz * 2 / MOST, -1.f), 1.f)}};
                if (total > 0) {
                    float share = 1 / (OWN * total), soon = 1 / (MATCH * MOST), far = OWN / (total * R);
                    ask[1][0] = (mx * share - vx) * soon; ask[1][1] = (my * share - vy) * soon; ask[1][2] = (mz * share - vz) * soon;
                    ask[2][0] = cx * far; ask[2][1] = cy * far; ask[2][2] = cz * far;
                }
                float ax = 0, ay = 0, az = 0, used = 0;
                for (int u = 0; u < 4; u++) {
                    float size = std::sqrt(ask[u][0] * ask[u][0] + ask[u][1] * ask[u][1] + ask[u][2] * ask[u][2]);
                    float share = STRENGTH[u] / std::max(size, 1.f), mag = size * share;
                    if (used + mag > 1) share *= (1 - used) / mag;
                    ax += share * ask[u][0]; ay += share * ask[u][1]; az += share * ask[u][2]; used += mag;
                    if (used >= 1) break;
                }
                float drag = DAMPING * (CRUISE - speed);
                ax = ax * MOST + drag * fx; ay = ay * MOST + drag * fy; az = az * MOST + drag * fz;
                float wx = vx + DT * ax, wy = vy + DT * ay, wz = vz + DT * az, w = std::sqrt(wx * wx + wy * wy + wz * wz);
                float gx_ = wx / w, gy_ = wy / w, gz_ = wz / w;
                w = std::min(std::max(w, LEAST), TOP); wx = w * gx_ * OWN; wy = w * gy_ * OWN; wz = w * gz_ * OWN;
                // the frame: turned without roll, made orthonormal, banked
                float ux = B.ux[s], uy = B.uy[s], uz = B.uz[s], dot = fx * gx_ + fy * gy_ + fz * gz_, al = ux * gx_ + uy * gy_ + uz * gz_;
                float q = al / (1 + dot); ux -= q * (fx + gx_); uy -= q * (fy + gy_); uz -= q * (fz + gz_);
                al = ux * gx_ + uy * gy_ + uz * gz_; ux -= al * gx_; uy -= al * gy_; uz -= al * gz_;
                q = 1 / std::sqrt(ux * ux + uy * uy + uz * uz); ux *= q; uy *= q; uz *= q;
                float tx = (wx - bvx[s]) / DT, ty = (wy - bvy[s]) / DT, tz = (wz - bvz[s]) / DT + G9;
                al = tx * gx_ + ty * gy_ + tz * gz_; tx -= al * gx_; ty -= al * gy_; tz -= al * gz_;
                float rx = gy_ * uz - gz_ * uy, ry = gz_ * ux - gx_ * uz, rz = gx_ * uy - gy_ * ux;
                float angle = DT / ROLL * std::atan2(tx * rx + ty * ry + tz * rz, tx * ux + ty * uy + tz * uz), co = std::cos(angle), si = std::sin(angle);
                float px = co * ux + si * rx, py = co * uy + si * ry, pz = co * uz + si * rz;
                q = 1 / std::sqrt(px * px + py * py + pz * pz);
                int i = B.id[s];
                float x = xi + DT * wx, y = yi + DT * wy;
                A.x[i] = x - L * std::floor(x / L); A.y[i] = y - L * std::floor(y / L); A.z[i] = zi + DT * wz;
                A.vx[i] = wx; A.vy[i] = wy; A.vz[i] = wz; A.ux[i] = px * q; A.uy[i] = py * q; A.uz[i] = pz * q;
                if (count) nb += seen;
            }
        }
    }
    if (count) NB = nb / N;
}
static double cpu() { rusage r; getrusage(RUSAGE_SELF, &r); return r.ru_utime.tv_sec + 1e-6 * r.ru_utime.tv_usec + r.ru_stime.tv_sec + 1e-6 * r.ru_stime.tv_usec; }
int main(int c, char** a) {
    int64_t n; double p[3]; FILE* f = c > 2 ? fopen(a[1], "rb") : nullptr;
    if (!f || fread(&n, 8, 1, f) != 1 || fread(p, 8, 3, f) != 3) { fprintf(stderr, "use: boids_ceiling start.bin ticks\n"); return 1; }
    N = (int)n; L = (float)p[0]; R = (float)p[1]; SEP = (float)p[2];
    vector<float> x(3 * n), v(3 * n);
    if (fread(x.data(), 4, 3 * n, f) != (size_t)3 * n || fread(v.data(), 4, 3 * n, f) != (size_t)3 * n) return 1;
    A.size(N);
    for (int i = 0; i < N; i++) { A.x[i] = x[3 * i]; A.y[i] = x[3 * i + 1]; A.z[i] = x[3 * i + 2]; A.vx[i] = v[3 * i]; A.vy[i] = v[3 * i + 1]; A.vz[i] = v[3 * i + 2]; A.ux[i] = A.uy[i] = 0; A.uz[i] = 1; }
    for (int k = 0; k < 3; k++) tick(false);
    int ticks = atoi(a[2]); vector<double> wall, used;
    for (int k = 0; k < ticks; k++) {
        double u = cpu(); auto t = std::chrono::steady_clock::now(); tick(false);
        wall.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - t).count()); used.push_back(cpu() - u);
    }
    std::sort(wall.begin(), wall.end()); std::sort(used.begin(), used.end());
    tick(true);
    printf("{\"n\": %d, \"threads\": %d, \"ms_min\": %.4f, \"ms_median\": %.4f, \"cpu_ms_min\": %.4f, \"neighbours\": %.2f}\n", N, omp_get_max_threads(), 1e3 * wall[0], 1e3 * wall[ticks / 2], 1e3 * used[0], NB);
}
