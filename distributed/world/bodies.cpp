#include "distributed/world/bodies.hpp"

#include <algorithm>
#include <numeric>

namespace stiction::distributed {

template <class Real>
PartOfWorld<Real>::PartOfWorld(const WorldModelView<Real>& whole, const BodyList<Real>& bodies)
    : model_(whole, bodies.body), arrays_(model_.view(), 1) {
  for (std::size_t k = 0; k < bodies.size(); ++k)
    for_each_number([&](std::size_t width, const auto& from,
                        auto& to) { std::copy_n(from, width, to.data() + static_cast<std::size_t>(width) * k); },
                    bodies.numbers[k], arrays_);
}

template <class Real>
BodyNumbers<Real> PartOfWorld<Real>::numbers(std::size_t k) const {
  BodyNumbers<Real> numbers;
  for_each_number([&](std::size_t width, auto& to,
                      const auto& from) { std::copy_n(from.data() + static_cast<std::size_t>(width) * k, width, to); },
                  numbers, arrays_);
  return numbers;
}

template <class Real>
BodyNumbers<Real> numbers_at(std::span<const Real, 3> position, std::span<const Real, 4> orientation,
                             std::span<const Real, 6> twist) {
  BodyNumbers<Real> numbers{};
  std::copy(position.begin(), position.end(), numbers.position);
  std::copy(twist.begin(), twist.end(), numbers.twist);
  const auto q = [&](std::size_t k) { return static_cast<double>(orientation[k]); };
  put_unit({q(0), q(1), q(2), q(3)}, numbers.orientation);
  return numbers;
}

template <class Real>
Impulses<Real> sorted(const Impulses<Real>& from) {
  std::vector<std::size_t> order(from.id.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return from.id[a] < from.id[b]; });
  Impulses<Real> to;
  for (const std::size_t k : order) {
    if (!to.id.empty() && to.id.back() == from.id[k]) continue;
    to.id.push_back(from.id[k]);
    for (std::size_t j = 0; j < 3; ++j) to.impulse.push_back(from.impulse[3 * k + j]);
  }
  return to;
}

template <class Real>
BodyList<Real> sorted(const BodyList<Real>& from) {
  std::vector<std::size_t> order(from.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return from.body[a] < from.body[b]; });
  BodyList<Real> to;
  for (const std::size_t k : order) to.add(from.body[k], from.numbers[k]);
  return to;
}

template Impulses<float> sorted(const Impulses<float>&);
template Impulses<double> sorted(const Impulses<double>&);
template BodyList<float> sorted(const BodyList<float>&);
template BodyList<double> sorted(const BodyList<double>&);
template BodyNumbers<float> numbers_at(std::span<const float, 3>, std::span<const float, 4>, std::span<const float, 6>);
template BodyNumbers<double> numbers_at(std::span<const double, 3>, std::span<const double, 4>,
                                        std::span<const double, 6>);
template class PartOfWorld<float>;
template class PartOfWorld<double>;

}  // namespace stiction::distributed
