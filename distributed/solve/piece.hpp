#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/job/body_job.hpp"
#include "core/plan/body_plan.hpp"
#include "distributed/solve/halo.hpp"

/// One rank's piece of one environment, decided in integers from the environment's plan and its owners.
namespace stiction::distributed {

/// Which ranks visit the contacts of an environment, and where they are in its order.
class Visitors {
 public:
  /// `owner`: the rank of each body of the environment.
  Visitors(const BodyPlanData& data, Offset env, std::span<const int> owner);

  /// Owners of the bodies that the contact at position p pushes, `first` that of the lower side. If nothing is pushed,
  /// both are the owner of a body that is there.
  struct Pair {
    int first, second;
    [[nodiscard]] bool has(int rank) const { return rank == first || rank == second; }
  };
  [[nodiscard]] Pair of(Index p) const { return pairs_[static_cast<std::size_t>(p)]; }
  /// The rank that gives the answer for the contact at position p.
  [[nodiscard]] int home(Index p) const { return of(p).first; }
  [[nodiscard]] Index color_of(Index p) const { return colors_[static_cast<std::size_t>(p)]; }

 private:
  std::vector<Pair> pairs_;    ///< by position
  std::vector<Index> colors_;  ///< by position
};

/// Numbers of bodies and contacts in this are the piece's, in the environment's order.
template <class Real>
class Piece {
 public:
  Piece(const BodyJob<Real>& job, const BodyPlanData& plan, Offset env, std::span<const int> owner, int rank);

  /// The piece as a batch of one environment, with room for its solution. Valid while the piece is where it is.
  [[nodiscard]] BodyJob<Real> job() const;
  [[nodiscard]] const Rounds& rounds() const { return rounds_; }
  [[nodiscard]] Offset bodies() const { return static_cast<Offset>(bodies_.size()); }
  [[nodiscard]] Offset contacts() const { return static_cast<Offset>(positions_.size()); }
  /// Ghosts: bodies that another rank owns.
  [[nodiscard]] Offset ghosts() const;

  /// Returns the rank's results: impulse and w of each contact whose home it is, then twists of the bodies it owns.
  [[nodiscard]] std::vector<Real> answer(bool with_w) const;
  [[nodiscard]] const EnvStatus& status() const { return status_; }

 private:
  void choose(const BodyPlanData& data, std::span<const int> owner);
  void copy_numbers(const BodyJob<Real>& job);
  void make_plan(const BodyPlanData& data);
  void make_rounds(const BodyPlanData& data, std::span<const int> owner);
  void note_body(const BodyPlanData& data, std::span<const int> owner, Index body);
  void add_to_round(Index round, int rank, Index body, bool is_sent);

  Offset env_, body_base_ = 0, contact_base_ = 0;
  int rank_;
  Visitors visitors_;
  TimeStepping stepping_;
  BodySolverOptions options_;
  std::vector<Index> bodies_;     ///< the environment's numbers, ascending                       (bodies)
  std::vector<char> is_owned_;    ///<                                                            (bodies)
  std::vector<Index> local_;      ///< the piece's number of each body of the environment, or -1
  std::vector<Index> positions_;  ///< the environment's, ascending                               (contacts)
  Rounds rounds_;

  BodyArrays<Real> arrays_;  ///< contacts are in the order of positions
  std::vector<Real> warm_start_;
  BodyPlanData plan_;
  mutable std::vector<Real> impulse_, twist_out_, w_;
  mutable EnvStatus status_{};
};

/// Returns the size of answer() of that rank.
std::size_t answer_size(const BodyPlanData& plan, Offset env, const Visitors& visitors, std::span<const int> owner,
                        int rank, bool with_w);
/// Puts the answer of that rank where the batch's solution has it.
template <class Real>
void take_answer(const BodyBatchView<Real>& batch, const BodyPlanData& plan, Offset env, const Visitors& visitors,
                 std::span<const int> owner, int rank, std::span<const Real> answer,
                 const BodySolutionView<Real>& solution);

}  // namespace stiction::distributed
