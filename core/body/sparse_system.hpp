#pragma once

#include "core/block/phases.hpp"
#include "core/block/reduce.hpp"
#include "core/body/cone_shape.hpp"
#include "core/body/env_view.hpp"
#include "core/body/system.hpp"

namespace stiction::inline STICTION_ISA {

/// An environment on the batch's own sparsity pattern, rows and cones in file order. Motion is pulled: a cone gathers
/// its rows of (A + diag R) x + b when it is visited, and cones of one colour share no entry, so a colour is one
/// parallel phase (docs/math/pgs.md).
template <class RealType>
struct SparseSystem : SystemArrays<RealType, 1> {
  using Real = RealType;
  static constexpr int kStride = 1;
  static constexpr bool kMaintainsMotion = false;

  const EnvView<Real>* env = nullptr;
  Index n = 0;
  Index cones = 0;
  Strided<Real, 1> value;   ///< CSR values in the solver's coordinates, without R  (entry span)
  Strided<Real, 1> R;       ///< compliance in the solver's coordinates             (n)
  Strided<Real, 1> blocks;  ///< diagonal block of the cone at row r from 6 r on    (6 n)

  static Offset elements(Offset rows, Offset cone_total, Offset nonzeros, Offset method_vectors) {
    return SystemArrays<Real, 1>::elements(rows, cone_total, method_vectors) + 7 * rows + nonzeros;
  }

  STICTION_HD SparseSystem(const EnvView<Real>& environment, Offset method_vectors, Real* memory)
      : env(&environment), n(environment.n), cones(environment.cone_count) {
    R = this->carve({memory}, n, cones, method_vectors);
    blocks = R.from(n);
    value = blocks.from(Offset{6} * n);
  }

  [[nodiscard]] STICTION_HD Real block_entry(Index row, int i, int j) const { return blocks[row * 6 + i * 6 + j]; }

  [[nodiscard]] STICTION_HD Strided<Real, 1> vector(Index k) const { return this->extra.from(Offset{k} * n); }

  template <Block B, class F>
  STICTION_HD void for_each_cone(B& block, F&& f) const {
    for_each(block, cones, [&](Index cone) {
      with_shape(env->kind[cone], env->cone_size(cone), [&](auto shape) { f(shape, cone, env->cone_row(cone)); });
    });
  }

  template <Block B, class F>
  STICTION_HD Real sum_over_cones(B& block, F&& f) const {
    return sum_leaves<Real>(block, [&](Index leaf) {
      Real sum(0);
      for (Index cone = leaf; cone < cones; cone += kReduceLeaves)
        with_shape(env->kind[cone], env->cone_size(cone),
                   [&](auto shape) { sum = sum + f(shape, cone, env->cone_row(cone)); });
      return sum;
    });
  }

  /// start + row i of A times in, over four interleaved partial sums in stored order.
  template <bool kAbsolute = false>
  [[nodiscard]] STICTION_HD Real gather(Index i, Strided<Real, 1> in, Real start) const {
    const Offset begin = env->row_offsets[i];
    const Real* a = value.data + (begin - env->row_offsets[0]);
    const Index* column = env->columns(i);
    const Offset count = env->entries(i);
    const auto entry = [](Real v) { return kAbsolute ? abs_(v) : v; };
    Real sum[4] = {start, Real(0), Real(0), Real(0)};
    Offset k = 0;
    for (; k + 4 <= count; k += 4)
      for (int lane = 0; lane < 4; ++lane) sum[lane] = fma_(entry(a[k + lane]), in[column[k + lane]], sum[lane]);
    for (int lane = 0; k < count; ++k, ++lane) sum[lane] = fma_(entry(a[k]), in[column[k]], sum[lane]);
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
  }

  template <bool kAbsolute = false, Block B, class Base, class Store>
  STICTION_HD void multiply(B& block, Strided<Real, 1> in, Base&& base, Store&& store) const {
    for_each(block, n, [&](Index i) { store(i, gather<kAbsolute>(i, in, fma_(R[i], in[i], base(i)))); });
  }
};

}  // namespace stiction::inline STICTION_ISA
