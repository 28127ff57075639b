#include "distributed/subdomains/region.hpp"

#include <algorithm>
#include <utility>

#include "stiction/batch_arrays.hpp"

namespace stiction::distributed {

namespace {

std::size_t at(Offset index) {
  return static_cast<std::size_t>(index);
}

template <class T>
T* row6(std::vector<T>& numbers, Offset row) {
  return numbers.data() + 6 * row;
}
template <class T>
const T* row6(const std::vector<T>& numbers, Offset row) {
  return numbers.data() + 6 * row;
}

template <class T>
void append(std::vector<T>& to, const T* from, Offset row, Offset width) {
  to.insert(to.end(), from + row * width, from + (row + 1) * width);
}

InverseMass<double> mass_of(const auto& inv_mass, const auto& inv_inertia, Offset row) {
  return {static_cast<double>(inv_mass[at(row)]), load6<double>(row6(inv_inertia, row))};
}

}  // namespace

template <class Real>
Region<Real>::Region(const BodyBatchView<Real>& batch, const Subdomains& parts, int rank, int ranks,
                     const TimeStepping& stepping, const BodySolverOptions& options, const Real* warm_start)
    : stepping_(stepping), options_(options) {
  const auto is_before = [&](int subdomain, int other) { return parts.rank_of(subdomain, ranks) < other; };
  while (first_ < parts.count() && is_before(first_, rank)) ++first_;
  last_ = first_;
  while (last_ < parts.count() && is_before(last_, rank + 1)) ++last_;
  for (int subdomain = first_; subdomain < last_; ++subdomain) add_subdomain(batch, parts, subdomain, warm_start);
  own_inv_mass_ = arrays_.inv_mass;
  own_inv_inertia_ = arrays_.inv_inertia;
  own_change_ = arrays_.twist_change;
  guess_ = impulse_;
  twist_out_.resize(at(6 * bodies()));
  status_.resize(at(last_ - first_));
  gaps_.resize(status_.size());
  change_.resize(at(6 * bodies()));
  free_.resize(change_.size());
  judged_.resize(change_.size());
  find_shared(parts, rank, ranks);
}

template <class Real>
void Region<Real>::add_subdomain(const BodyBatchView<Real>& from, const Subdomains& parts, int subdomain,
                                 const Real* warm_start) {
  const std::vector<Index>& bodies = parts.bodies[at(subdomain)];
  for (const Index body : bodies) {
    body_of_row_.push_back(body);
    for_each_body_array(
        1,
        [body](const BatchArray& what, auto& to, const auto* numbers) {
          if (numbers != nullptr) append(to, numbers, body, what.width);
        },
        arrays_, from);
  }
  arrays_.twist_change.resize(arrays_.twist.size());
  arrays_.kinematic.resize(arrays_.inv_mass.size());
  const auto local = [&](Index body) {
    if (body < 0) return -1;
    return static_cast<Index>(std::lower_bound(bodies.begin(), bodies.end(), body) - bodies.begin());
  };
  for (const Index contact : parts.contacts[at(subdomain)]) {
    for_each_contact_array(
        1,
        [contact](const BatchArray& what, auto& to, const auto* numbers) { append(to, numbers, contact, what.width); },
        arrays_, from);
    for (std::vector<Index>* side : {&arrays_.body_a, &arrays_.body_b}) side->back() = local(side->back());
    if (warm_start != nullptr) append(impulse_, warm_start, contact, 3);
  }
  impulse_.resize(3 * arrays_.mu.size());
  arrays_.env_body_offsets.push_back(static_cast<Offset>(arrays_.inv_mass.size()));
  arrays_.env_contact_offsets.push_back(static_cast<Offset>(arrays_.mu.size()));
}

template <class Real>
void Region<Real>::find_shared(const Subdomains& parts, int rank, int ranks) {
  std::vector<Index> shared_of(parts.holders.size(), -1);
  std::vector<Neighbour> neighbours(at(ranks));
  for (std::size_t body = 0; body < parts.holders.size(); ++body) {
    const std::vector<int>& holders = parts.holders[body];
    const auto is_here = [&](int subdomain) { return parts.rank_of(subdomain, ranks) == rank; };
    if (holders.size() < 2 || std::none_of(holders.begin(), holders.end(), is_here)) continue;
    shared_of[body] = static_cast<Index>(shared_.size());
    shared_.push_back({static_cast<Index>(subdomain_.size()), static_cast<Index>(holders.size())});
    for (const int holder : holders) {
      const auto slot = static_cast<Index>(subdomain_.size());
      subdomain_.push_back(holder);
      row_.push_back(-1);
      const int home = parts.rank_of(holder, ranks);
      if (home != rank) neighbours[at(home)].receive.push_back(slot);
    }
    // Each of a rank's copies goes to every other rank that has one.
    for (int other = 0; other < ranks; ++other) {
      const auto is_there = [&](int subdomain) { return parts.rank_of(subdomain, ranks) == other; };
      if (other == rank || std::none_of(holders.begin(), holders.end(), is_there)) continue;
      for (std::size_t k = 0; k < holders.size(); ++k)
        if (is_here(holders[k]))
          neighbours[at(other)].send.push_back(shared_.back().first_slot + static_cast<Index>(k));
    }
  }
  z_.resize(6 * shared_.size());
  told_.resize(6 * subdomain_.size());
  u_.resize(told_.size());
  rounds_.resize(1);
  for (int other = 0; other < ranks; ++other) {
    Neighbour& neighbour = neighbours[at(other)];
    neighbour.rank = other;
    if (!neighbour.send.empty()) rounds_.front().push_back(neighbour);
  }
  for (int subdomain = first_; subdomain < last_; ++subdomain)
    for (Offset row = arrays_.env_body_offsets[at(subdomain - first_)];
         row < arrays_.env_body_offsets[at(subdomain - first_ + 1)]; ++row) {
      const Index body = body_of_row_[at(row)];
      const std::vector<int>& holders = parts.holders[at(body)];
      if (!holders.empty() && holders.front() != subdomain) ++ghosts_;
      if (shared_of[at(body)] < 0) continue;
      const Shared& shared = shared_[at(shared_of[at(body)])];
      for (Index slot = shared.first_slot; slot < shared.first_slot + shared.copies; ++slot)
        if (subdomain_[at(slot)] == subdomain) row_[at(slot)] = static_cast<Index>(row);
    }
}

namespace {

/// Environment `subdomain` of a region as the body's own numbers have it.
template <class Real>
BodyEnv<Real> own_env(const BodyBatchView<Real>& batch, const BodyPlanView& plan, Offset subdomain) {
  return slice_bodies(BodyJob<Real>{batch, plan, {}, nullptr, {}, {}}, subdomain);
}

}  // namespace

template <class Real>
BodyBatchView<Real> Region<Real>::batch() const {
  return arrays_.view();
}

template <class Real>
BodyBatchView<Real> Region<Real>::own_batch() const {
  BodyBatchView<Real> view = batch();
  view.inv_mass = own_inv_mass_.data();
  view.inv_inertia = own_inv_inertia_.data();
  view.twist_change = own_change_.data();
  return view;
}

template <class Real>
BodySolutionView<Real> Region<Real>::solution() {
  return {impulse_.data(), twist_out_.data(), nullptr, status_.data()};
}

template <class Real>
const Real* Region<Real>::first_guess() {
  guess_ = impulse_;
  return guess_.data();
}

template <class Real>
void Region<Real>::use_plan(const BodyPlanView& plan) {
  plan_ = plan;
  const BodyBatchView<Real> own = own_batch();
  for (Offset subdomain = 0; subdomain < own.env_count; ++subdomain) {
    const BodyEnv<Real> env = own_env(own, plan_, subdomain);
    for (Index body = 0; body < env.bodies; ++body) {
      const Offset row = arrays_.env_body_offsets[at(subdomain)] + body;
      free_twist_of(env, body, row6(change_, row), row6(free_, row));
    }
  }
  // The first z is the motion by forces alone.
  for_each_copy(
      [&](const Shared&, Index which, Index, Index row) { std::copy_n(row6(free_, row), 6, row6(z_, which)); });
}

template <class Real>
template <class F>
void Region<Real>::for_each_copy(F&& f) {
  for (std::size_t which = 0; which < shared_.size(); ++which)
    for (Index k = 0; k < shared_[which].copies; ++k) {
      const Index slot = shared_[which].first_slot + k;
      if (row_[at(slot)] >= 0) f(shared_[which], static_cast<Index>(which), slot, row_[at(slot)]);
    }
}

template <class Real>
void Region<Real>::set_penalty(double penalty, double factor) {
  for_each_copy([&](const Shared& shared, Index, Index slot, Index row) {
    const double gain = copy_gain(shared.copies, penalty);
    share_mass(gain, own_inv_mass_[at(row)], row6(own_inv_inertia_, row), arrays_.inv_mass[at(row)],
               row6(arrays_.inv_inertia, row));
    scale_dual(factor, row6(u_, slot));
  });
}

template <class Real>
void Region<Real>::pull(double penalty) {
  for_each_copy([&](const Shared&, Index which, Index slot, Index row) {
    pull_copy(row6(z_, which), row6(u_, slot), row6(free_, row), row6(change_, row), penalty,
              row6(arrays_.twist_change, row));
  });
}

template <class Real>
bool Region<Real>::has_moved() {
  return std::exchange(has_moved_, false);
}

template <class Real>
void Region<Real>::ask(double relaxation) {
  has_moved_ = has_moved_ || impulse_ != guess_;
  for (const EnvStatus& status : status_)
    is_broken_ = is_broken_ || status.code == EnvCode::invalid_input || status.code == EnvCode::numerical;
  for_each_copy([&](const Shared&, Index which, Index slot, Index row) {
    ask_for(relaxation, row6(twist_out_, row), row6(z_, which), row6(u_, slot), row6(told_, slot));
  });
}

template <class Real>
void Region<Real>::meet(const std::vector<double>* before) {
  z_before_ = before == nullptr ? z_ : *before;
  for (std::size_t which = 0; which < shared_.size(); ++which)
    mean_of(row6(told_, shared_[which].first_slot), shared_[which].copies, row6(z_, static_cast<Offset>(which)));
  std::fill(gaps_.begin(), gaps_.end(), ConsensusGap{});
  for_each_copy([&](const Shared& shared, Index which, Index slot, Index row) {
    settle_copy(mass_of(own_inv_mass_, own_inv_inertia_, row), shared.copies, row6(twist_out_, row), row6(told_, slot),
                row6(z_, which), row6(z_before_, which), row6(u_, slot), gaps_[at(subdomain_[at(slot)] - first_)]);
  });
}

template <class Real>
void Region<Real>::meet_again() {
  meet(&last_z_);
  asked_ = told_;
}

template <class Real>
void Region<Real>::restore_asked(double factor) {
  last_z_ = z_;
  for (std::size_t which = 0; which < shared_.size(); ++which) {
    const double* z = row6(z_, static_cast<Offset>(which));
    for (Index slot = shared_[which].first_slot; slot < shared_[which].first_slot + shared_[which].copies; ++slot)
      scale_asked(factor, z, asked_.empty() ? z : row6(asked_, slot), row6(told_, slot));
  }
}

template <class Real>
void Region<Real>::tell_changes() {
  const BodyBatchView<Real> own = own_batch();
  for (Offset subdomain = 0; subdomain < own.env_count; ++subdomain) {
    const BodyEnv<Real> env = own_env(own, plan_, subdomain);
    const Real* impulse = impulse_.data() + 3 * arrays_.env_contact_offsets[at(subdomain)];
    for (Index body = 0; body < env.bodies; ++body) {
      double* pushed = row6(judged_, arrays_.env_body_offsets[at(subdomain)] + body);
      std::fill_n(pushed, 6, 0.0);
      if (!env.is_kinematic(body)) pushed_change(env, body, impulse, pushed);
    }
  }
  for_each_copy(
      [&](const Shared&, Index, Index slot, Index row) { std::copy_n(row6(judged_, row), 6, row6(told_, slot)); });
}

template <class Real>
LargestResidual<double> Region<Real>::judge() {
  for (Offset row = 0; row < bodies(); ++row) sum_changes(row6(judged_, row), 1, row6(free_, row), row6(judged_, row));
  for_each_copy([&](const Shared& shared, Index, Index, Index row) {
    sum_changes(row6(told_, shared.first_slot), shared.copies, row6(free_, row), row6(judged_, row));
  });
  LargestResidual<double> largest;
  const BodyBatchView<Real> own = own_batch();
  const SiParams params = si_params(stepping_, options_);
  for (Offset subdomain = 0; subdomain < own.env_count; ++subdomain) {
    const BodyEnv<Real> env = own_env(own, plan_, subdomain);
    const Real* impulse = impulse_.data() + 3 * arrays_.env_contact_offsets[at(subdomain)];
    const double* twists = row6(judged_, arrays_.env_body_offsets[at(subdomain)]);
    const Law law = contact_law(options_);
    if (law == kBoxFriction) {
      evaluate_subdomain<kBoxFriction>(env, params, impulse, twists, 1.0, largest);
    } else if (law == Law::convex) {
      evaluate_subdomain<Law::convex>(env, params, impulse, twists, 1.0, largest);
    } else {
      evaluate_subdomain<Law::coulomb>(env, params, impulse, twists, 1.0, largest);
    }
  }
  return largest;
}

template <class Real>
double Region<Real>::scale() const {
  const BodyBatchView<Real> own = own_batch();
  const SiParams params = si_params(stepping_, options_);
  double largest = 0;
  const Law law = contact_law(options_);
  for (Offset subdomain = 0; subdomain < own.env_count; ++subdomain) {
    const BodyEnv<Real> env = own_env(own, plan_, subdomain);
    if (law == kBoxFriction) {
      largest = largest_error_at_rest<kBoxFriction>(env, params, largest);
    } else if (law == Law::convex) {
      largest = largest_error_at_rest<Law::convex>(env, params, largest);
    } else {
      largest = largest_error_at_rest<Law::coulomb>(env, params, largest);
    }
  }
  return largest;
}

template class Region<float>;
template class Region<double>;

}  // namespace stiction::distributed
