#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "scenes/rng.hpp"
#include "stiction/derivative.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Derivatives of batches on the host, with memory of their own.
namespace stiction::test {

template <class Real>
struct Gradients {
  std::vector<Real> A, factor, b, R, mu, lo, hi;
  std::vector<GradientStatus> status;

  [[nodiscard]] BatchCotangentView<Real> view() {
    return {A.data(), factor.data(), b.data(), R.data(), mu.data(), lo.data(), hi.data()};
  }
  /// All numbers, one after another.
  [[nodiscard]] std::vector<Real> all() const {
    std::vector<Real> numbers;
    for (const auto* part : {&A, &factor, &b, &R, &mu, &lo, &hi})
      numbers.insert(numbers.end(), part->begin(), part->end());
    return numbers;
  }
};

template <class Real>
Gradients<Real> vjp(const ContactBatchView<Real>& batch, const std::vector<Real>& lambda,
                    const std::vector<Real>& lambda_bar, const std::vector<Real>& w_bar,
                    const DerivativeOptions& options = {}, const EnvStatus* status = nullptr, Offset count = 1) {
  const auto rows = static_cast<std::size_t>(count * batch.row_count);
  const auto room = [](Offset size) { return std::vector<Real>(static_cast<std::size_t>(size), Real(77)); };
  Gradients<Real> to{room(count * batch.nonzero_count), room(count * batch.factor_count), {}, {}, {}, {}, {}, {}};
  to.b = to.R = to.mu = to.lo = to.hi = std::vector<Real>(rows, Real(77));
  to.status.resize(static_cast<std::size_t>(batch.env_count));
  Derivative(Device::cpu(), options)
      .vjp(batch, ReactionView<Real>{lambda.data(), status},
           SolutionCotangentView<Real>{lambda_bar.empty() ? nullptr : lambda_bar.data(),
                                       w_bar.empty() ? nullptr : w_bar.data()},
           to.view(), to.status.data(), count);
  return to;
}

/// Changes of the solution along changes of the batch.
template <class Real>
struct Changes {
  std::vector<Real> lambda, w;
  std::vector<GradientStatus> status;

  /// All numbers, one after another.
  [[nodiscard]] std::vector<Real> all() const {
    std::vector<Real> numbers = lambda;
    numbers.insert(numbers.end(), w.begin(), w.end());
    return numbers;
  }
};
template <class Real>
Changes<Real> jvp(const ContactBatchView<Real>& batch, const std::vector<Real>& lambda,
                  const BatchTangentView<Real>& tangents, const DerivativeOptions& options = {}, Offset count = 1) {
  const auto rows = static_cast<std::size_t>(count * batch.row_count);
  Changes<Real> to{std::vector<Real>(rows, Real(77)), std::vector<Real>(rows, Real(77)),
                   std::vector<GradientStatus>(static_cast<std::size_t>(batch.env_count))};
  Derivative(Device::cpu(), options)
      .jvp(batch, ReactionView<Real>{lambda.data(), nullptr}, tangents,
           SolutionTangentView<Real>{to.lambda.data(), to.w.data()}, to.status.data(), count);
  return to;
}

/// Returns a loss's derivatives by every number: uniform in [-1, 1].
template <class Real = double>
std::vector<Real> random_numbers(std::size_t count, std::uint64_t seed) {
  scenes::Rng rng(seed);
  std::vector<Real> numbers(count);
  for (Real& number : numbers) number = static_cast<Real>(rng.symmetric(1.0));
  return numbers;
}

template <class Real>
double dot(const std::vector<Real>& a, const std::vector<Real>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  return sum;
}
/// The sum of the sizes of a dot product's terms.
template <class Real>
double dot_of_sizes(const std::vector<Real>& a, const std::vector<Real>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(static_cast<double>(a[i]) * static_cast<double>(b[i]));
  return sum;
}

}  // namespace stiction::test
