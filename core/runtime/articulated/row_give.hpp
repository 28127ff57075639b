#pragma once

#include <array>

#include "core/job/articulated_job.hpp"

/// From MuJoCo's solref and solimp to a row's parameters (MuJoCo documentation, "Solver parameters").
namespace stiction {

/// MuJoCo's smallest number, and the bounds of an impedance.
inline constexpr double kTiny = 1e-15, kLeastImpedance = 1e-4, kMostImpedance = 0.9999;

/// Stiffness and damping of a reference, by its time constant or directly.
inline std::array<double, 2> rates_of(const ArticulatedDescription& model, std::array<double, 2> solref,
                                      double impedance) {
  const auto divisor = [](double x) { return x > kTiny ? x : kTiny; };
  if (solref[0] > 0) {
    const double least = 2 * model.timestep;
    const double time = model.keeps_references && solref[0] < least ? least : solref[0];
    return {1 / divisor(impedance * impedance * time * time * solref[1] * solref[1]), 2 / divisor(impedance * time)};
  }
  return {-solref[0] / divisor(impedance * impedance), -solref[1] / divisor(impedance)};
}

/// x to a power, by products: no library reaches the model.
inline double power_of(double x, Index power) {
  double product = 1;
  for (Index k = 0; k < power; ++k) product *= x;
  return product;
}

template <class T>
RowGive<T> give_of(const ArticulatedDescription& model, const ArticulatedGive& from, double weight,
                   const std::array<double, 2>& tangential = {}) {
  const auto impedance = [](double x) {
    return x < kLeastImpedance ? kLeastImpedance : x > kMostImpedance ? kMostImpedance : x;
  };
  const double low = impedance(from.solimp[0]), high = impedance(from.solimp[1]);
  const double width = from.solimp[2], middle = impedance(from.solimp[3]);
  const auto power = static_cast<Index>(from.solimp[4]);
  const bool is_flat = low == high || width <= kTiny;
  RowGive<T> to{};
  to.low = static_cast<T>(is_flat ? 0.5 * (low + high) : low);
  to.rise = static_cast<T>(is_flat ? 0 : high - low);
  to.inverse_width = static_cast<T>(is_flat ? 1 : 1 / width);
  to.power = power;
  to.middle = static_cast<T>(power == 1 ? 2 : middle);
  to.up = static_cast<T>(1 / power_of(middle, power - 1));
  to.down = static_cast<T>(1 / power_of(1 - middle, power - 1));
  const auto normal = rates_of(model, from.solref, high);
  const bool is_own = tangential[0] != 0 || tangential[1] != 0;
  to.stiffness = static_cast<T>(normal[0]);
  to.damping = static_cast<T>(normal[1]);
  to.tangential_damping = static_cast<T>(is_own ? rates_of(model, tangential, high)[1] : normal[1]);
  to.weight = static_cast<T>(weight);
  return to;
}

}  // namespace stiction
