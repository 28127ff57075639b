#pragma once

#include <cstddef>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction {

/// One environment's A, with diag R where that is asked for. It is divided by a power of two that brings its largest
/// number near 1, so that squares of entries neither overflow nor vanish. The batch's structure is sound.
class EnvironmentOperator {
 public:
  template <class Real>
  EnvironmentOperator(const ContactBatchView<Real>& batch, Offset env, bool with_compliance);

  [[nodiscard]] std::size_t rows() const { return compliance_.size(); }
  [[nodiscard]] Offset nonzeros() const { return static_cast<Offset>(value_.size()); }  ///< as stored
  [[nodiscard]] bool is_finite() const { return is_finite_; }
  [[nodiscard]] double unscaled(
      double value) const;  ///< a norm of this operator as one of the environment's [w / lambda]
  [[nodiscard]] double diagonal(std::size_t row) const;
  [[nodiscard]] std::vector<double> multiply(const std::vector<double>& x) const;             ///< A x
  [[nodiscard]] std::vector<double> multiply_transposed(const std::vector<double>& x) const;  ///< A' x
  [[nodiscard]] std::vector<double> dense() const;  ///< row-major, rows x rows

 private:
  void scale();

  bool is_finite_ = true, is_factor_ = false;
  int exponent_ = 0;                  ///< the environment's operator is 2^exponent_ times this one
  std::vector<std::size_t> offsets_;  ///< CSR rows of A; of Y where A = Y Y'   (rows + 1)
  std::vector<std::size_t> column_;
  std::vector<double> value_, compliance_;
};

}  // namespace stiction
