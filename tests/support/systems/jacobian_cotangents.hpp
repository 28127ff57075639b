#pragma once

#include <array>
#include <vector>

#include "stiction/derivative.hpp"

/// Memory for what derivatives by J and M read and write, on the host.
namespace stiction::test {

template <class Real>
struct JacobianGradients {
  std::vector<Real> J, M, v_free, target, R, mu, lo, hi;
  std::vector<GradientStatus> status;

  /// Room for `count` sets, none of which is written yet.
  explicit JacobianGradients(const JacobianBatchView<Real>& view, Offset count = 1)
      : J(room(count * view.entry_count)),
        M(room(count * view.mass_count)),
        v_free(room(count * view.dof_count)),
        target(room(count * view.row_count)),
        R(target),
        mu(target),
        lo(target),
        hi(target),
        status(static_cast<std::size_t>(view.env_count)) {}
  [[nodiscard]] JacobianBatchCotangentView<Real> view() {
    return {J.data(), M.data(), v_free.data(), target.data(), R.data(), mu.data(), lo.data(), hi.data()};
  }
  /// These numbers as changes.
  [[nodiscard]] JacobianBatchTangentView<Real> tangents() const {
    return {J.data(), M.data(), v_free.data(), target.data(), R.data(), mu.data(), lo.data(), hi.data()};
  }
  [[nodiscard]] auto parts() { return std::array{&J, &M, &v_free, &target, &R, &mu, &lo, &hi}; }
  /// All numbers, one after another.
  [[nodiscard]] std::vector<Real> all() const {
    std::vector<Real> numbers;
    for (const auto* part : {&J, &M, &v_free, &target, &R, &mu, &lo, &hi})
      numbers.insert(numbers.end(), part->begin(), part->end());
    return numbers;
  }

 private:
  static std::vector<Real> room(Offset size) { return std::vector<Real>(static_cast<std::size_t>(size), Real(77)); }
};

/// Cotangents, or changes, of a solution of J and M.
template <class Real>
struct JacobianChanges {
  std::vector<Real> lambda, w, velocity;
  std::vector<GradientStatus> status;

  explicit JacobianChanges(const JacobianBatchView<Real>& view, Offset count = 1)
      : lambda(static_cast<std::size_t>(count * view.row_count), Real(77)),
        w(lambda),
        velocity(static_cast<std::size_t>(count * view.dof_count), Real(77)),
        status(static_cast<std::size_t>(view.env_count)) {}
  [[nodiscard]] JacobianSolutionTangentView<Real> view() { return {lambda.data(), w.data(), velocity.data()}; }
  [[nodiscard]] JacobianSolutionCotangentView<Real> cotangents() const {
    return {lambda.data(), w.data(), velocity.data()};
  }
  [[nodiscard]] std::vector<Real> all() const {
    std::vector<Real> numbers = lambda;
    numbers.insert(numbers.end(), w.begin(), w.end());
    numbers.insert(numbers.end(), velocity.begin(), velocity.end());
    return numbers;
  }
};

}  // namespace stiction::test
