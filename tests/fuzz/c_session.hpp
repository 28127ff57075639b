#pragma once

#include <optional>
#include <type_traits>

#include "tests/fuzz/c_answers.hpp"
#include "tests/fuzz/c_batches.hpp"
#include "tests/fuzz/c_options.hpp"

namespace stiction::fuzz {

/// A handle and its kind: destroyed ones stay here, to be used again.
template <class Handle>
struct Held {
  Handle* handle = nullptr;
  bool alive = false;
};

/// Calls of one kind of solver of the C interface on batches that edits have spoiled, in any order.
template <class Real>
class Session {
 public:
  ~Session();
  void call(Bytes& bytes);  ///< one call, which the bytes choose

 private:
  void create(Bytes& bytes);
  void destroy(Bytes& bytes);
  void edit(Bytes& bytes);
  void restore();
  void solve_contacts(Bytes& bytes);
  void judge_contacts(Bytes& bytes);
  void solve_jacobians(Bytes& bytes);
  void solve_bodies(Bytes& bytes);
  void step(Bytes& bytes);
  void reset_environments(Bytes& bytes);
  void require_neighbours(const Answers<Real>& answers);

  CForm<stiction_batch_view> contacts_ = contact_form<Real>();
  CForm<stiction_jacobian_view> jacobians_ = jacobian_form<Real>();
  CForm<stiction_body_view> bodies_ = body_form<Real>();
  bool reached_[kEnvs] = {};                ///< environments of contacts_ that an edit reached
  std::optional<Answers<Real>> untouched_;  ///< the solver's answer before any edit
  Held<stiction_solver> solver_;
  Held<stiction_jacobian_solver> jacobian_solver_;
  Held<stiction_body_solver> body_solver_;
  Held<stiction_stepping_solver> stepping_[3];  ///< for contacts, Jacobian batches, bodies
};

extern template class Session<float>;
extern template class Session<double>;

/// Calls that need no batch: names, defaults, devices, hashes, files that are not there.
void call_library(Bytes& bytes);

}  // namespace stiction::fuzz
