#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/runtime/check/expect.hpp"
#include "stiction/batch_arrays.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/solver.hpp"

/// Which memory a call reads and which it writes. A solve reads its inputs while other environments are written, and
/// judges answers by the inputs at the end. An output that lies in an input would be answered wrongly, and then be
/// judged by the input that it has overwritten.
namespace stiction {

/// An array of a call, under the name that the caller knows.
struct NamedArray {
  const char* name;
  const void* begin = nullptr;
  std::size_t bytes = 0;
  const char* owner = "";  ///< prefix of the name

  template <class T>
  static NamedArray of(const char* name, const T* array, Offset count, const char* owner = "") {
    return {name, array, array == nullptr ? 0 : static_cast<std::size_t>(count) * sizeof(T), owner};
  }
  [[nodiscard]] std::string text() const { return std::string(owner) + name; }
};

inline bool overlap(const NamedArray& a, const NamedArray& b) {
  const auto at = [](const NamedArray& array) { return reinterpret_cast<std::uintptr_t>(array.begin); };
  return a.bytes > 0 && b.bytes > 0 && at(a) < at(b) + b.bytes && at(b) < at(a) + a.bytes;
}

/// \throws Error(invalid_argument) that names an output and an array that it shares memory with: output or input.
inline void refuse_overlaps(std::span<const NamedArray> outputs, std::span<const NamedArray> inputs) {
  const auto check = [](const NamedArray& output, const NamedArray& other) {
    if (overlap(output, other))
      refuse(output.text() + " and " + other.text() + " overlap in memory: give " + output.text() +
             " memory of its own");
  };
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) check(outputs[i], outputs[k]);
    for (const NamedArray& input : inputs) check(outputs[i], input);
  }
}

/// The arrays of a list (stiction/batch_arrays.hpp), each in `sets` that follow one another.
class ListedArrays {
 public:
  explicit ListedArrays(const char* owner, Offset sets = 1) : owner_(owner), sets_(sets) {}
  template <class T>
  void operator()(const BatchArray& what, const T* array) {
    found_.push_back(NamedArray::of(what.name, array, sets_ * what.length, owner_));
  }
  [[nodiscard]] std::vector<NamedArray> take() { return std::move(found_); }

 private:
  const char* owner_;
  Offset sets_;
  std::vector<NamedArray> found_;
};

template <class Batch>
std::vector<NamedArray> arrays_of(const Batch& batch) {
  ListedArrays list("batch.");
  for_each_array(batch, list, batch);
  return list.take();
}
template <class Real>
std::vector<NamedArray> arrays_of(const BodyBatchView<Real>& batch) {
  ListedArrays list("batch.");
  for_each_array(batch, list, batch);
  list(BatchArray{"contact_id", batch.contact_count}, batch.contact_id);
  return list.take();
}

/// Cotangents or tangents of the batch's numbers, in so many sets.
template <class Numbers, class Batch>
std::vector<NamedArray> arrays_of(const char* owner, const Numbers& numbers, const Batch& batch, Offset sets) {
  ListedArrays list(owner, sets);
  for_each_change_array(batch, list, numbers);
  return list.take();
}

template <class Real>
auto arrays_of(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution) {
  return std::array{NamedArray::of("solution.lambda", solution.lambda, batch.row_count),
                    NamedArray::of("solution.w", solution.w, batch.row_count),
                    NamedArray::of("solution.status", solution.status, batch.env_count)};
}

template <class Real>
auto arrays_of(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution) {
  return std::array{NamedArray::of("solution.lambda", solution.lambda, batch.row_count),
                    NamedArray::of("solution.w", solution.w, batch.row_count),
                    NamedArray::of("solution.velocity", solution.velocity, batch.dof_count),
                    NamedArray::of("solution.status", solution.status, batch.env_count)};
}

template <class Real>
auto arrays_of(const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution) {
  return std::array{NamedArray::of("solution.impulse", solution.impulse, 3 * batch.contact_count),
                    NamedArray::of("solution.twist", solution.twist, 6 * batch.body_count),
                    NamedArray::of("solution.w", solution.w, 3 * batch.contact_count),
                    NamedArray::of("solution.status", solution.status, batch.env_count)};
}

/// Refuses overlaps of a first guess and the outputs. It may be the array that it is a guess of: an environment's
/// guess is read before its answer is written.
inline void refuse_overlaps_of_guess(std::span<const NamedArray> outputs, std::size_t guessed,
                                     const NamedArray& guess) {
  for (std::size_t i = 0; i < outputs.size(); ++i)
    if (i != guessed || guess.begin != outputs[i].begin) refuse_overlaps(outputs.subspan(i, 1), std::span(&guess, 1));
}

/// Refuses overlaps of a batch, its answer, and the reactions that it starts from, which are the first output's.
template <class Batch, class Solution, class Real>
void refuse_overlaps(const Batch& batch, const Solution& solution, const Real* warm_start) {
  const auto outputs = arrays_of(batch, solution);
  refuse_overlaps(outputs, arrays_of(batch));
  refuse_overlaps_of_guess(outputs, 0, {"warm_start", warm_start, warm_start == nullptr ? 0 : outputs[0].bytes});
}
template <class Real>
void refuse_overlaps(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
                     const JacobianStart<Real>& start) {
  refuse_overlaps(batch, solution, start.reactions);
  const auto outputs = arrays_of(batch, solution);
  constexpr std::size_t kVelocity = 2;
  refuse_overlaps_of_guess(outputs, kVelocity, NamedArray::of("start.velocities", start.velocities, batch.dof_count));
}

}  // namespace stiction
