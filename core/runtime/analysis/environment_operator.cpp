#include "core/runtime/analysis/environment_operator.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/extents.hpp"

namespace stiction {
namespace {

/// The largest exponent e for which some |value| is at least 2^(e - 1); 0 if all are zero.
int largest_exponent(const std::vector<double>& values) {
  double largest = 0;
  for (const double value : values)
    if (std::fabs(value) > largest) largest = std::fabs(value);
  int exponent = 0;
  std::frexp(largest, &exponent);
  return exponent;
}

bool is_zero(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return value == 0; });
}

}  // namespace

template <class Real>
EnvironmentOperator::EnvironmentOperator(const ContactBatchView<Real>& batch, Offset env, bool with_compliance)
    : is_factor_(batch.env_dofs(env) > 0), offsets_{0} {
  const Index rows = batch.env_rows(env), dofs = batch.env_dofs(env);
  const Offset first = batch.env_row_offsets[env];
  for (Index i = 0; i < rows; ++i) {
    const Index count = is_factor_ ? dofs : batch.row_entries(first + i);
    const Real* values = is_factor_ ? batch.factor + batch.factor_offsets[env] + Offset{i} * dofs
                                    : batch.A + batch.row_offsets[first + i];
    for (Index k = 0; k < count; ++k) {
      column_.push_back(static_cast<std::size_t>(is_factor_ ? k : batch.row_columns(first + i)[k]));
      value_.push_back(static_cast<double>(values[k]));
    }
    offsets_.push_back(value_.size());
    compliance_.push_back(with_compliance ? static_cast<double>(batch.R[first + i]) : 0.0);
  }
  for (const auto* values : {&value_, &compliance_})
    for (const double value : *values) is_finite_ = is_finite_ && std::isfinite(value);
  if (is_finite_) scale();
}

void EnvironmentOperator::scale() {
  const int stored = largest_exponent(value_);
  const int of_A = is_factor_ ? 2 * stored : stored;
  exponent_ = is_zero(compliance_) ? of_A : largest_exponent(compliance_);
  if (!is_zero(value_)) exponent_ = larger_of(exponent_, of_A);
  if (is_factor_ && exponent_ % 2 != 0) ++exponent_;
  for (double& value : value_) value = std::ldexp(value, is_factor_ ? -exponent_ / 2 : -exponent_);
  for (double& value : compliance_) value = std::ldexp(value, -exponent_);
}

double EnvironmentOperator::unscaled(double value) const {
  return std::ldexp(value, exponent_);
}

double EnvironmentOperator::diagonal(std::size_t row) const {
  double sum = compliance_[row];
  for (std::size_t k = offsets_[row]; k < offsets_[row + 1]; ++k) {
    if (is_factor_) sum += value_[k] * value_[k];
    if (!is_factor_ && column_[k] == row) sum += value_[k];
  }
  return sum;
}

std::vector<double> EnvironmentOperator::multiply(const std::vector<double>& x) const {
  const auto times = [this](const std::vector<double>& from, std::vector<double> to) {
    for (std::size_t i = 0; i < rows(); ++i)
      for (std::size_t k = offsets_[i]; k < offsets_[i + 1]; ++k) to[i] += value_[k] * from[column_[k]];
    return to;
  };
  std::vector<double> y(rows());
  for (std::size_t i = 0; i < rows(); ++i) y[i] = compliance_[i] * x[i];
  if (!is_factor_) return times(x, std::move(y));
  std::vector<double> motion(offsets_[1]);
  for (std::size_t i = 0; i < rows(); ++i)
    for (std::size_t k = offsets_[i]; k < offsets_[i + 1]; ++k) motion[column_[k]] += value_[k] * x[i];
  return times(motion, std::move(y));
}

std::vector<double> EnvironmentOperator::multiply_transposed(const std::vector<double>& x) const {
  if (is_factor_) return multiply(x);
  std::vector<double> y(rows());
  for (std::size_t i = 0; i < rows(); ++i) y[i] = compliance_[i] * x[i];
  for (std::size_t i = 0; i < rows(); ++i)
    for (std::size_t k = offsets_[i]; k < offsets_[i + 1]; ++k) y[column_[k]] += value_[k] * x[i];
  return y;
}

std::vector<double> EnvironmentOperator::dense() const {
  const std::size_t n = rows();
  std::vector<double> matrix(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    double* const row = matrix.data() + i * n;
    if (!is_factor_) {
      for (std::size_t k = offsets_[i]; k < offsets_[i + 1]; ++k) row[column_[k]] += value_[k];
    } else {
      for (std::size_t j = 0; j < n; ++j)
        for (std::size_t k = 0; k < offsets_[1]; ++k) row[j] += value_[offsets_[i] + k] * value_[offsets_[j] + k];
    }
    row[i] += compliance_[i];
  }
  return matrix;
}

template EnvironmentOperator::EnvironmentOperator(const ContactBatchView<float>&, Offset, bool);
template EnvironmentOperator::EnvironmentOperator(const ContactBatchView<double>&, Offset, bool);

}  // namespace stiction
