#pragma once

#include <cstdint>
#include <vector>

#include "core/algorithm/rigid/consensus.hpp"
#include "distributed/solve/halo.hpp"
#include "distributed/subdomains/subdomains.hpp"

/// One rank's subdomains, as environments of one batch, with their copies of shared bodies.
namespace stiction::distributed {

template <class Real>
class Region {
 public:
  /// Subdomains of `rank` among `ranks`, of a batch of one environment.
  Region(const BodyBatchView<Real>& batch, const Subdomains& parts, int rank, int ranks, const TimeStepping& stepping,
         const BodySolverOptions& options, const Real* warm_start);

  /// Local problems as a batch: copies have their share of the mass, and the penalty's. Valid while the region lives.
  [[nodiscard]] BodyBatchView<Real> batch() const;
  [[nodiscard]] BodySolutionView<Real> solution();
  /// Impulses of the solve before, by local contact.
  [[nodiscard]] const Real* first_guess();
  /// Round 0: rows of six numbers that copies exchange, at `told()`.
  [[nodiscard]] const Rounds& rounds() const { return rounds_; }
  [[nodiscard]] double* told() { return told_.data(); }

  /// The solver's plan of batch(), which outlives the region; before all else.
  void use_plan(const BodyPlanView& plan);
  /// Copies have the masses of that penalty, and duals that are divided by `factor`.
  void set_penalty(double penalty, double factor);
  /// Pulls each copy to z - u, before a solve.
  void pull(double penalty);
  /// Into told(): the copies' requests, after a solve.
  void ask(double relaxation);
  /// Takes the mean of all copies' requests, which has moved since they met before.
  void meet() { meet(nullptr); }
  /// After rounds that did not wait: contacts have moved if they did since restore_asked(). Keeps told().
  void meet_again();
  /// Puts told() back as it was kept, with duals that are divided by `factor`. At first copies ask for z.
  void restore_asked(double factor);
  /// Into told(): changes of each copy's twist by its contacts.
  void tell_changes();
  /// Judges the impulses here, once all others' changes have come.
  [[nodiscard]] LargestResidual<double> judge();
  /// Largest |b| of the contacts here [w].
  [[nodiscard]] double scale() const;

  [[nodiscard]] int first() const { return first_; }
  [[nodiscard]] const std::vector<ConsensusGap>& gaps() const {
    return gaps_;
  }  ///< of each subdomain here, in the last round
  /// Returns true if a round has changed an impulse since this was last asked.
  [[nodiscard]] bool has_moved();
  /// Returns true if a subdomain had no finite answer in some round so far.
  [[nodiscard]] bool is_broken() const { return is_broken_; }
  /// By contact of each subdomain here, in their order.
  [[nodiscard]] const std::vector<Real>& impulses() const { return impulse_; }
  [[nodiscard]] Offset bodies() const { return static_cast<Offset>(arrays_.inv_mass.size()); }
  /// Copies of bodies whose first copy is elsewhere.
  [[nodiscard]] Offset ghosts() const { return ghosts_; }
  [[nodiscard]] Offset contacts() const { return static_cast<Offset>(arrays_.mu.size()); }

 private:
  /// A body that other subdomains push as well.
  struct Shared {
    Index first_slot = 0, copies = 0;
  };
  void add_subdomain(const BodyBatchView<Real>& from, const Subdomains& parts, int subdomain, const Real* warm_start);
  void meet(const std::vector<double>* before);
  void find_shared(const Subdomains& parts, int rank, int ranks);
  /// The batch with the bodies' own masses.
  [[nodiscard]] BodyBatchView<Real> own_batch() const;
  /// f(shared, its number, slot, row) for each copy that is here.
  template <class F>
  void for_each_copy(F&& f);

  TimeStepping stepping_;
  BodySolverOptions options_;
  int first_ = 0, last_ = 0;  ///< subdomains
  Offset ghosts_ = 0;
  bool is_broken_ = false, has_moved_ = true;
  BodyPlanView plan_;

  BodyArrays<Real> arrays_;  ///< of the subdomains one after the other
  std::vector<Index> body_of_row_;
  std::vector<Real> own_inv_mass_, own_inv_inertia_, own_change_;  ///< the body's, not the copy's
  std::vector<Real> impulse_, guess_, twist_out_;
  std::vector<EnvStatus> status_;

  std::vector<Shared> shared_;
  std::vector<double> z_, z_before_;    ///< six numbers of each shared body
  std::vector<double> last_z_;          ///< z_ of when told_ was put back
  std::vector<Index> row_, subdomain_;  ///< of each slot, a copy of a shared body: its row here or -1
  std::vector<double> told_, u_;        ///< six numbers of each slot
  std::vector<double> asked_;           ///< told_ of another time, or nothing
  std::vector<double> change_, free_;   ///< six numbers of each row, of the body
  std::vector<double> judged_;          ///< six numbers of each row
  std::vector<ConsensusGap> gaps_;
  Rounds rounds_;
};

}  // namespace stiction::distributed
