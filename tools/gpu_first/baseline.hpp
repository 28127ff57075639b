#pragma once

#include <cmath>

#include "stiction/config.hpp"
#include "stiction/types.hpp"

/// Newton's method in velocities as in textbooks, to compare with (Todorov 2014). The threads of a block take an
/// environment. J and H are dense, numbers are of single precision, sums go in any order. The arithmetic is
/// MuJoCo Warp's, without its launches and its traffic of memory between them. It is meant as a bound from below, and
/// no GPU has timed it. This is a peer, and not an algorithm of the library, which would stand once, in core/. Nothing
/// of the library's is used but names of cones.
///
/// A Block has kBaselineThreads threads, on a GPU or as a loop on the CPU. for_threads(f) calls f(thread) in each and
/// waits for all; sum(f) is the sum of f(thread).
namespace stiction::gpu_first {

/// Environments with dense matrices, each with those of its own size.
struct BaselineBatch {
  Offset envs = 0;
  Index most_rows = 0, most_dofs = 0;
  const Offset *row = nullptr, *cone = nullptr, *dof = nullptr;  ///< first of each environment  (envs + 1)
  const Offset *J_begin = nullptr, *M_begin = nullptr;           ///< first entry of each        (envs)
  const ConeKind* kind = nullptr;                                ///< of each cone
  const Offset* cone_row = nullptr;                              ///< first row of each cone, and the end
  const float *J = nullptr, *M = nullptr;                        ///< row-major
  const float *v_free = nullptr, *start = nullptr;               ///< of degrees of freedom
  const float *target = nullptr, *R = nullptr, *mu = nullptr, *lo = nullptr, *hi = nullptr;  ///< of rows
};
/// Arrays that answers go to.
struct BaselineAnswer {
  float *velocity = nullptr, *lambda = nullptr;
  Index* steps = nullptr;  ///< of each environment
};

inline constexpr int kBaselineThreads = 64;
inline constexpr int kBaselineSide = 8;  ///< threads as a square
inline constexpr Index kBaselineSteps = 50, kBaselineTrials = 20;

/// Numbers of one environment in the block's shared memory. H has one row more, for the right-hand side.
struct BaselineMemory {
  float *H, *GJ, *z, *x, *Jp, *slope, *unit, *v, *q, *p, *Mp;
  Index pitch;

  STICTION_HD static Index pitch_of(Index dofs) { return (dofs + 1) | 1; }
  static std::size_t floats(Index rows, Index dofs) {
    return static_cast<std::size_t>(pitch_of(dofs)) * static_cast<std::size_t>(dofs + 1) +
           static_cast<std::size_t>(rows) * static_cast<std::size_t>(dofs + 5) + 4 * static_cast<std::size_t>(dofs);
  }
  STICTION_HD BaselineMemory(float* memory, Index rows, Index dofs) : H(memory), pitch(pitch_of(dofs)) {
    GJ = H + static_cast<Offset>(pitch) * (dofs + 1);
    z = GJ + static_cast<Offset>(rows) * dofs;
    x = z + rows;
    Jp = x + rows;
    slope = Jp + rows;
    unit = slope + rows;
    v = unit + rows;
    q = v + dofs;
    p = q + dofs;
    Mp = p + dofs;
  }
};

inline constexpr Index kBaselineConeRows = 6;
/// Calls f(row) for the rows of a cone, with a number of turns that the compiler knows: numbers by row stay in
/// registers.
template <class F>
STICTION_HD void each_row(Index first, Index rows, F&& f) {
  for (Index k = first; k < kBaselineConeRows; ++k)
    if (k < rows) f(k);
}

/// A cone's reaction to its rows' motion, and minus the derivative of that, G. Coordinates are the
/// circular cone's: tangential rows times mu. In them G is h (1, d)(1, d)' + turn (0 0; 0 1 - d d') while it slides.
struct ConeResponse {
  float reaction[kBaselineConeRows], direction[kBaselineConeRows], diagonal[kBaselineConeRows];
  float h = 0, turn = 0;
  bool slides = false;
};
STICTION_HD ConeResponse respond(const BaselineBatch& batch, Offset first, Index rows, ConeKind kind, const float* z) {
  ConeResponse out;
  const float* const R = batch.R + first;
  if (kind != ConeKind::friction) {
    each_row(0, rows, [&](Index k) {
      const float wanted = -z[k] / R[k];
      float low = -INFINITY, high = INFINITY;
      if (kind == ConeKind::unilateral) low = 0;
      if (kind == ConeKind::box) low = batch.lo[first + k], high = batch.hi[first + k];
      out.reaction[k] = wanted < low ? low : (wanted > high ? high : wanted);
      out.diagonal[k] = wanted < low || wanted > high ? 0.0F : 1 / R[k];
    });
    return out;
  }
  const float* const mu = batch.mu + first;
  float square = 0;
  each_row(1, rows, [&](Index k) { square += mu[k] * z[k] * mu[k] * z[k]; });
  const float length = std::sqrt(square), pressing = -z[0] / R[0];
  const float tangential = std::fmax(R[1] * mu[1] * mu[1], 1e-30F);
  const bool sticks = length <= tangential * pressing, opens = !sticks && z[0] >= length;
  each_row(0, rows, [&](Index k) {
    out.reaction[k] = sticks ? -z[k] / R[k] : 0.0F;
    out.diagonal[k] = sticks ? 1 / R[k] : 0.0F;
  });
  if (sticks || opens) return out;
  out.slides = true;
  out.h = 1 / (R[0] + tangential);
  const float normal = (length - z[0]) * out.h;
  out.turn = normal / length;
  out.reaction[0] = normal;
  each_row(1, rows, [&](Index k) {
    out.direction[k] = -mu[k] * z[k] / length;
    out.reaction[k] = mu[k] * normal * out.direction[k];
  });
  return out;
}
/// result = G y.
STICTION_HD void apply(const ConeResponse& cone, const float* mu, Index rows, const float* y, float* result) {
  if (!cone.slides) return each_row(0, rows, [&](Index k) { result[k] = cone.diagonal[k] * y[k]; });
  float along = 0;
  each_row(1, rows, [&](Index k) { along += cone.direction[k] * mu[k] * y[k]; });
  const float both = cone.h * (y[0] + along);
  result[0] = both;
  each_row(1, rows, [&](Index k) {
    result[k] = mu[k] * (cone.turn * (mu[k] * y[k] - cone.direction[k] * along) + cone.direction[k] * both);
  });
}

/// One environment: until H's norm of the next step is `tolerance` times M's norm of the reactions' change.
template <class Block>
STICTION_HD void solve_baseline(Block& block, const BaselineBatch& batch, const BaselineAnswer& answer, Offset env,
                                float tolerance, float* memory) {
  const Offset row = batch.row[env], cone = batch.cone[env], dof = batch.dof[env];
  const auto rows = static_cast<Index>(batch.row[env + 1] - row),
             cones = static_cast<Index>(batch.cone[env + 1] - cone);
  const auto n = static_cast<Index>(batch.dof[env + 1] - dof);
  const float *const J = batch.J + batch.J_begin[env], *const M = batch.M + batch.M_begin[env];
  const BaselineMemory own(memory, rows, n);
  const auto each = [&](Index count, auto&& f) {
    block.for_threads([&](int thread) {
      for (Index i = thread; i < count; i += kBaselineThreads) f(i);
    });
  };
  const auto total = [&](Index count, auto&& f) {
    return block.sum([&](int thread) {
      float sum = 0;
      for (Index i = thread; i < count; i += kBaselineThreads) sum += f(i);
      return sum;
    });
  };
  /// f(first row within the environment, rows, response, row in the batch) of cone c, at the motion z + t J p.
  const auto with_cone = [&](Index c, float t, auto&& f) {
    const Offset first = batch.cone_row[cone + c];
    const auto count = static_cast<Index>(batch.cone_row[cone + c + 1] - first), at = static_cast<Index>(first - row);
    float moved[kBaselineConeRows];
    each_row(0, count,
             [&](Index k) { moved[k] = t == 0 ? own.z[at + k] : std::fma(t, own.Jp[at + k], own.z[at + k]); });
    return f(at, count, respond(batch, first, count, batch.kind[cone + c], moved), first);
  };
  const auto times = [&](const float* matrix, Index i, const float* vector) {
    float sum = 0;
    for (Index j = 0; j < n; ++j) sum = std::fma(matrix[i * n + j], vector[j], sum);
    return sum;
  };
  /// Begins at given velocities: z, and q = M (v - v_free).
  const auto begin = [&](const float* velocity) {
    each(n, [&](Index i) { own.v[i] = velocity[dof + i], own.p[i] = velocity[dof + i] - batch.v_free[dof + i]; });
    each(n + rows, [&](Index i) {
      if (i < n) own.q[i] = times(M, i, own.p);
      if (i >= n) own.z[i - n] = times(J, i - n, own.v) - batch.target[row + i - n];
    });
    const float kinetic = total(n, [&](Index i) { return own.p[i] * own.q[i]; });
    const float potential = total(cones, [&](Index c) {
      return with_cone(c, 0, [&](Index at, Index count, const ConeResponse& response, Offset first) {
        // The potential at z: the largest of -z x - R x^2 / 2 over reactions x.
        float sum = 0;
        each_row(0, count, [&](Index k) {
          sum -= response.reaction[k] * (own.z[at + k] + batch.R[first + k] * response.reaction[k] / 2);
        });
        return sum;
      });
    });
    return kinetic / 2 + potential;
  };
  if (batch.start != nullptr) {
    const float warm = begin(batch.start), cold = begin(batch.v_free);
    if (warm <= cold) begin(batch.start);
  } else {
    begin(batch.v_free);
  }

  Index steps = 0;
  float energy = total(n, [&](Index i) { return own.q[i] * (own.v[i] - batch.v_free[dof + i]); });
  for (; steps < kBaselineSteps; ++steps) {
    // Reactions and G J; then H = M + J' G J over the right-hand side J' x - q.
    block.for_threads([&](int thread) {
      for (Index item = thread; item < cones * kBaselineSide; item += kBaselineThreads)
        with_cone(item / kBaselineSide, 0, [&](Index at, Index count, const ConeResponse& response, Offset first) {
          const Index side = item % kBaselineSide;
          float column[kBaselineConeRows], slope[kBaselineConeRows];
          each_row(0, side == 0 ? count : 0, [&](Index k) {
            own.x[at + k] = response.reaction[k];
            own.slope[at + k] = response.slides || response.diagonal[k] != 0 ? 1.0F : 0.0F;
          });
          for (Index j = side; j < n; j += kBaselineSide) {
            each_row(0, count, [&](Index k) { column[k] = J[(at + k) * n + j]; });
            apply(response, batch.mu + first, count, column, slope);
            each_row(0, count, [&](Index k) { own.GJ[(at + k) * n + j] = slope[k]; });
          }
        });
    });
    block.for_threads([&](int thread) {
      const Index down = thread / kBaselineSide, across = thread % kBaselineSide;
      for (Index i = down; i < n; i += kBaselineSide)
        for (Index j = across; j <= i; j += kBaselineSide) {
          float sum = M[i * n + j];
          for (Index r = 0; r < rows; ++r)
            if (own.slope[r] != 0) sum = std::fma(J[r * n + i], own.GJ[r * n + j], sum);
          own.H[i * own.pitch + j] = sum;
        }
      for (Index i = thread; i < n; i += kBaselineThreads) {
        float sum = -own.q[i];
        for (Index r = 0; r < rows; ++r) sum = std::fma(J[r * n + i], own.x[r], sum);
        own.H[n * own.pitch + i] = sum;
        own.Mp[i] = sum;  // factor of p for the slope at the start
      }
    });
    // H = L L', and the last row becomes L^-1 times the right-hand side.
    for (Index k = 0; k < n; ++k) {
      const float pivot = std::sqrt(own.H[k * own.pitch + k]);
      block.for_threads([&](int) {});
      each(n + 1 - k, [&](Index i) {
        if (i > 0) own.H[(k + i) * own.pitch + k] /= pivot;
        if (i == 0) own.H[k * own.pitch + k] = pivot;
      });
      block.for_threads([&](int thread) {
        for (Index i = k + 1 + thread / kBaselineSide; i <= n; i += kBaselineSide)
          for (Index j = k + 1 + thread % kBaselineSide; j <= i && j < n; j += kBaselineSide)
            own.H[i * own.pitch + j] =
                std::fma(-own.H[i * own.pitch + k], own.H[j * own.pitch + k], own.H[i * own.pitch + j]);
      });
    }
    each(n, [&](Index i) { own.p[i] = own.H[n * own.pitch + i]; });
    for (Index k = n - 1; k >= 0; --k) {
      const float found = own.p[k] / own.H[k * own.pitch + k];
      block.for_threads([&](int) {});
      each(k + 1, [&](Index i) { own.p[i] = i == k ? found : std::fma(-own.H[k * own.pitch + i], found, own.p[i]); });
    }
    const float slope = -total(n, [&](Index i) { return own.Mp[i] * own.p[i]; });
    if (!(-slope > tolerance * tolerance * energy)) break;

    each(n + rows, [&](Index i) {
      if (i < n) own.Mp[i] = times(M, i, own.p);
      if (i >= n) own.Jp[i - n] = times(J, i - n, own.p);
    });
    const float qp = total(n, [&](Index i) { return own.q[i] * own.p[i]; });
    const float pMp = total(n, [&](Index i) { return own.Mp[i] * own.p[i]; });
    // The zero of f' along p by Newton's method in a bracket.
    float t = 1, low = 0, high = INFINITY;
    for (Index trial = 0; trial < kBaselineTrials; ++trial) {
      const auto along = [&](bool second) {
        return total(cones, [&](Index c) {
          return with_cone(c, t, [&](Index at, Index count, const ConeResponse& response, Offset first) {
            float result[kBaselineConeRows], sum = 0;
            if (second) apply(response, batch.mu + first, count, own.Jp + at, result);
            each_row(0, count, [&](Index k) { sum += (second ? result[k] : -response.reaction[k]) * own.Jp[at + k]; });
            return sum;
          });
        });
      };
      const float first = std::fma(t, pMp, qp) + along(false);
      if (std::fabs(first) <= 0.1F * std::fabs(slope)) break;
      (first < 0 ? low : high) = t;
      const float next = t - first / (pMp + along(true));
      t = next > low && next < high ? next : (std::isinf(high) ? 2 * t : (low + high) / 2);
    }
    each(n + rows, [&](Index i) {
      if (i < n) own.v[i] = std::fma(t, own.p[i], own.v[i]), own.q[i] = std::fma(t, own.Mp[i], own.q[i]);
      if (i >= n) own.z[i - n] = std::fma(t, own.Jp[i - n], own.z[i - n]);
    });
    energy = total(n, [&](Index i) { return own.q[i] * (own.v[i] - batch.v_free[dof + i]); });
  }
  each(n, [&](Index i) { answer.velocity[dof + i] = own.v[i]; });
  each(rows, [&](Index i) { answer.lambda[row + i] = own.x[i]; });
  each(1, [&](Index) { answer.steps[env] = steps; });
}

/// A block as a loop, one thread after the other.
struct LoopBlock {
  template <class F>
  void for_threads(F&& f) {
    for (int thread = 0; thread < kBaselineThreads; ++thread) f(thread);
  }
  template <class F>
  float sum(F&& f) {
    float all = 0;
    for (int thread = 0; thread < kBaselineThreads; ++thread) all += f(thread);
    return all;
  }
};

/// Queues the batch's solve on a GPU; every pointer is there. Does nothing in a build without CUDA.
void launch_baseline(const BaselineBatch& batch, const BaselineAnswer& answer, float tolerance, void* stream);

}  // namespace stiction::gpu_first
