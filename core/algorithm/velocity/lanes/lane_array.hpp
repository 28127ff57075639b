#pragma once

#include <type_traits>

#include "core/algorithm/velocity/lanes/dof_set.hpp"
#include "core/base/pack.hpp"
#include "core/team/phases.hpp"

/// Arrays of numbers of which every lane has its own, side by side.
namespace stiction::inline STICTION_ISA {

/// Element i of lane l is data[i * kStride + l]. `Wide` is a Pack of all lanes or of a part of them, which `data` then
/// points into. For a lane of a GPU's warp it is one number.
template <class Wide, int kStride>
struct LaneArray {
  Scalar<Wide>* data = nullptr;

  STICTION_HD Wide operator[](Offset i) const {
    Wide value;
    load_lanes(data + i * kStride, value);
    return value;
  }
  STICTION_HD void put(Offset i, Wide value) const { store_lanes(data + i * kStride, value); }
  /// One lane's number.
  [[nodiscard]] STICTION_HD Scalar<Wide>& at(Offset i, int lane) const { return data[i * kStride + lane]; }
  [[nodiscard]] STICTION_HD LaneArray from(Offset i) const { return {data + i * kStride}; }
};

/// Doubles of as many lanes as one vector of Wide's size has.
template <class Wide>
struct DoubleLanes {
  using Type = double;
  static constexpr int kLanes = 1;
};
template <class T, int W>
struct DoubleLanes<Pack<T, W>> {
  static constexpr int kLanes = W * static_cast<int>(sizeof(T)) / static_cast<int>(sizeof(double));
  using Type = Pack<double, kLanes>;
};

/// Types that Newton's method in velocities runs in: `Wide` for iterations, `Double` for judging, `Real` for the
/// batch's numbers. Lanes of a `Team` own a pack together.
template <class WideT, int kStrideT = RealTraits<WideT>::kLanes, class SetT = DofSet, class RealT = Scalar<WideT>,
          Team TeamT = SerialTeam>
struct LaneTypes {
  using Wide = WideT;
  using Team = TeamT;
  using Set = SetT;  ///< of degrees of freedom
  using Real = RealT;
  using Number = Scalar<WideT>;
  using Double = typename DoubleLanes<WideT>::Type;
  static constexpr int kLanes = RealTraits<WideT>::kLanes;
  static constexpr int kDoubleLanes = DoubleLanes<WideT>::kLanes;
  static constexpr int kStride = kStrideT;
  using Numbers = LaneArray<Wide, kStride>;
  using Doubles = LaneArray<Double, kStride>;
};

/// Numbers of a LaneArray as doubles, from lane `first` on.
template <int W>
STICTION_HD void widen(const float* from, Pack<double, W>& to) {
  to.v = __builtin_convertvector(*reinterpret_cast<const typename VectorOf<float, W>::Anywhere*>(from),
                                 typename VectorOf<double, W>::Type);
}
template <int W>
STICTION_HD void widen(const double* from, Pack<double, W>& to) {
  load_lanes(from, to);
}
template <class Real>
STICTION_HD void widen(const Real* from, double& to) {
  to = static_cast<double>(*from);
}
/// Doubles as numbers of a LaneArray.
template <int W>
STICTION_HD void narrow(Pack<double, W> value, float* to) {
  *reinterpret_cast<typename VectorOf<float, W>::Anywhere*>(to) =
      __builtin_convertvector(value.v, typename VectorOf<float, W>::Type);
}
template <int W>
STICTION_HD void narrow(Pack<double, W> value, double* to) {
  store_lanes(to, value);
}
template <class Real>
STICTION_HD void narrow(double value, Real* to) {
  *to = static_cast<Real>(value);
}
/// Doubles as the nearest single-precision numbers.
template <int W>
STICTION_HD Pack<double, W> in_single(Pack<double, W> value) {
  const auto single = __builtin_convertvector(value.v, typename VectorOf<float, W>::Type);
  return __builtin_convertvector(single, typename VectorOf<double, W>::Type);
}
STICTION_HD double in_single(double value) {
  return static_cast<double>(static_cast<float>(value));
}
/// A batch's numbers, to where a LaneArray has them.
template <class T, int W>
STICTION_HD void put_numbers(Pack<T, W> value, T* to) {
  store_lanes(to, value);
}
template <int W>
STICTION_HD void put_numbers(Pack<float, W> value, double* to) {
  const Pack<double, W> wide = __builtin_convertvector(value.v, typename VectorOf<double, W>::Type);
  store_lanes(to, wide);
}
template <class Double, class Wide, int kStride>
STICTION_HD Double doubles(const LaneArray<Wide, kStride>& numbers, Offset i, int first) {
  Double value;
  widen(numbers.data + i * kStride + first, value);
  return value;
}

/// One lane's number.
STICTION_HD double lane_of(double value, int) {
  return value;
}
template <int W>
STICTION_HD double lane_of(Pack<double, W> value, int lane) {
  return value.v[lane];
}

}  // namespace stiction::inline STICTION_ISA
