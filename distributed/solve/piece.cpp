#include "distributed/solve/piece.hpp"

#include <algorithm>
#include <numeric>

#include "distributed/solve/visits.hpp"
#include "stiction/batch_arrays.hpp"

namespace stiction::distributed {

namespace {

std::size_t at(Offset index) {
  return static_cast<std::size_t>(index);
}

bool is_pushed(Index side) {
  return side >= 0;
}
Index slot_of(Index side) {
  return side >= 0 ? side : ~side;
}

/// The plan's arrays of one environment.
struct EnvPlan {
  const Index *contact_order, *sides, *vertex_offsets, *color_offsets, *body_offsets, *body_contacts;
  Index kept, colors, bodies;

  EnvPlan(const BodyPlanData& plan, Offset env) {
    const Offset body = plan.env_body_offsets[at(env)], contact = plan.env_contact_offsets[at(env)];
    bodies = static_cast<Index>(plan.env_body_offsets[at(env) + 1] - body);
    kept = plan.kept[at(env)];
    colors = plan.color_count[at(env)];
    contact_order = plan.contact_order.data() + contact;
    sides = plan.sides.data() + 2 * contact;
    vertex_offsets = plan.vertex_offsets.data() + contact + env;
    color_offsets = plan.color_offsets.data() + contact + env;
    body_offsets = plan.body_offsets.data() + body + env;
    body_contacts = plan.body_contacts.data() + 2 * contact;
  }
  [[nodiscard]] Index side(Index p, int k) const { return sides[2 * Offset{p} + k]; }
};

/// f(position) for every contact whose answer is that rank's.
template <class F>
void for_each_home(const EnvPlan& plan, const Visitors& visitors, int rank, F&& f) {
  for (Index p = 0; p < plan.kept; ++p)
    if (visitors.home(p) == rank) f(p);
}

}  // namespace

Visitors::Visitors(const BodyPlanData& data, Offset env, std::span<const int> owner) {
  const EnvPlan plan(data, env);
  for (Index p = 0; p < plan.kept; ++p) {
    const Index a = plan.side(p, 0), b = plan.side(p, 1);
    if (is_pushed(a) || is_pushed(b)) {
      const int one = owner[at(is_pushed(a) ? a : b)], other = owner[at(is_pushed(b) ? b : a)];
      pairs_.push_back({one, other});
    } else {
      const int one = owner[at(slot_of(a) < plan.bodies ? slot_of(a) : slot_of(b))];
      pairs_.push_back({one, one});
    }
  }
  colors_ = colors_by_position(data, env);
}

std::vector<Index> colors_by_position(const BodyPlanData& data, Offset env) {
  const EnvPlan plan(data, env);
  std::vector<Index> colors(at(plan.kept));
  for (Index color = 0; color < plan.colors; ++color)
    for (Index v = plan.color_offsets[color]; v < plan.color_offsets[color + 1]; ++v)
      for (Index p = plan.vertex_offsets[v]; p < plan.vertex_offsets[v + 1]; ++p) colors[at(p)] = color;
  return colors;
}

template <class Real>
Piece<Real>::Piece(const BodyJob<Real>& job, const BodyPlanData& plan, Offset env, std::span<const int> owner, int rank)
    : env_(env),
      body_base_(job.batch.env_body_offsets[env]),
      contact_base_(job.batch.env_contact_offsets[env]),
      rank_(rank),
      visitors_(plan, env, owner),
      stepping_(job.stepping),
      options_(job.options) {
  choose(plan, owner);
  copy_numbers(job);
  make_plan(plan);
  make_rounds(plan, owner);
  impulse_.resize(at(3 * contacts()));
  w_.resize(impulse_.size());
  twist_out_.resize(at(6 * bodies()));
}

template <class Real>
void Piece<Real>::choose(const BodyPlanData& data, std::span<const int> owner) {
  const EnvPlan plan(data, env_);
  std::vector<char> here(owner.size(), 0);
  for (std::size_t body = 0; body < owner.size(); ++body) here[body] = owner[body] == rank_ ? 1 : 0;
  for (Index p = 0; p < plan.kept; ++p) {
    if (!visitors_.of(p).has(rank_)) continue;
    positions_.push_back(p);
    for (const int k : {0, 1})
      if (slot_of(plan.side(p, k)) < plan.bodies) here[at(slot_of(plan.side(p, k)))] = 1;
  }
  local_.assign(owner.size(), -1);
  for (std::size_t body = 0; body < owner.size(); ++body) {
    if (here[body] == 0) continue;
    local_[body] = static_cast<Index>(bodies_.size());
    bodies_.push_back(static_cast<Index>(body));
    is_owned_.push_back(owner[body] == rank_ ? 1 : 0);
  }
}

template <class Real>
void Piece<Real>::copy_numbers(const BodyJob<Real>& job) {
  const BodyBatchView<Real>& batch = job.batch;
  const auto append = [](auto& to, const auto* from, Offset row, Offset width) {
    if (from != nullptr) to.insert(to.end(), from + row * width, from + (row + 1) * width);
  };
  const auto append_row = [&append](Offset row) {
    return [&append, row](const BatchArray& what, auto& to, const auto* from) { append(to, from, row, what.width); };
  };
  arrays_.env_body_offsets = {0, bodies()};
  arrays_.env_contact_offsets = {0, contacts()};
  for (const Index body : bodies_) {
    const Offset row = body_base_ + body;
    for_each_body_array(1, append_row(row), arrays_, batch);
  }
  const Index* order = job.plan.contact_order + contact_base_;
  for (const Index p : positions_) {
    const Offset row = contact_base_ + order[p];
    const auto local = [&](Index body) { return body < 0 ? -1 : local_[at(body)]; };
    for_each_contact_array(1, append_row(row), arrays_, batch);
    for (std::vector<Index>* side : {&arrays_.body_a, &arrays_.body_b}) side->back() = local(side->back());
    append(warm_start_, job.warm_start, row, 3);
  }
}

/// The environment's plan, of the contacts that are here. Colours keep their number: one may have none of them.
template <class Real>
void Piece<Real>::make_plan(const BodyPlanData& data) {
  const EnvPlan plan(data, env_);
  const auto count = static_cast<Index>(contacts());
  plan_.env_body_offsets = arrays_.env_body_offsets;
  plan_.env_contact_offsets = arrays_.env_contact_offsets;
  plan_.kept = {count};
  plan_.color_count = {plan.colors};
  plan_.contact_order.resize(positions_.size());
  std::iota(plan_.contact_order.begin(), plan_.contact_order.end(), 0);
  const auto world = ~static_cast<Index>(bodies());
  for (const Index p : positions_)
    for (const int k : {0, 1}) {
      const Index side = plan.side(p, k);
      const Index slot = slot_of(side);
      const Index local = slot < plan.bodies ? local_[at(slot)] : -1;
      plan_.sides.push_back(slot == plan.bodies ? world : is_pushed(side) ? local : ~local);
    }
  plan_.color_offsets = {0};
  Index next = 0;  // position of the piece
  for (Index color = 0; color < plan.colors; ++color) {
    for (Index v = plan.color_offsets[color]; v < plan.color_offsets[color + 1]; ++v) {
      if (next == count || positions_[at(next)] != plan.vertex_offsets[v]) continue;
      plan_.vertex_offsets.push_back(next);
      next += plan.vertex_offsets[v + 1] - plan.vertex_offsets[v];
    }
    plan_.color_offsets.push_back(static_cast<Index>(plan_.vertex_offsets.size()));
  }
  plan_.vertex_offsets.push_back(count);
  // By body, in order of position.
  std::vector<Index>& begins = plan_.body_offsets;
  begins.assign(bodies_.size() + 1, 0);
  for (const Index side : plan_.sides)
    if (is_pushed(side)) ++begins[at(side) + 1];
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  plan_.body_contacts.resize(at(begins.back()));
  std::vector<Index> write(begins.begin(), begins.end() - 1);
  for (Index p = 0; p < count; ++p)
    for (const int k : {0, 1}) {
      const Index side = plan_.sides[at(2 * Offset{p} + k)];
      if (is_pushed(side)) plan_.body_contacts[at(write[at(side)]++)] = k == 1 ? p : ~p;
    }
}

template <class Real>
void Piece<Real>::add_to_round(Index round, int rank, Index body, bool is_sent) {
  Neighbour& neighbour = neighbour_of(rounds_[at(round)], rank);
  (is_sent ? neighbour.send : neighbour.receive).push_back(local_[at(body)]);
}

/// A body that others own or know. Owner and ghost find the same rounds, each for itself.
template <class Real>
void Piece<Real>::note_body(const BodyPlanData& data, std::span<const int> owner, Index body) {
  const EnvPlan plan(data, env_);
  const int own = owner[at(body)];
  std::vector<Visit> visits;
  std::vector<int> others;
  for (Index k = plan.body_offsets[body]; k < plan.body_offsets[body + 1]; ++k) {
    const Index entry = plan.body_contacts[k];
    const Index p = entry >= 0 ? entry : ~entry;
    const Visitors::Pair pair = visitors_.of(p);
    const int other = pair.first == own ? pair.second : pair.first;
    if (visits.empty() || visits.back().color != visitors_.color_of(p))
      visits.push_back({visitors_.color_of(p), other});
    if (other != own && (own == rank_ || other == rank_)) others.push_back(other);
  }
  std::sort(others.begin(), others.end());
  others.erase(std::unique(others.begin(), others.end()), others.end());
  for (const int ghost : others) {
    const int neighbour = own == rank_ ? ghost : own;
    for_each_round(visits, ghost, plan.colors,
                   [&](Index round) { add_to_round(round, neighbour, body, own == rank_); });
  }
}

template <class Real>
void Piece<Real>::make_rounds(const BodyPlanData& data, std::span<const int> owner) {
  rounds_.resize(at(plan_.color_count.front()) + 2);
  for (const Index body : bodies_) note_body(data, owner, body);
}

template <class Real>
BodyJob<Real> Piece<Real>::job() const {
  const auto optional = [](const auto& array) { return array.empty() ? nullptr : array.data(); };
  return {arrays_.view(),        plan_.view(), {impulse_.data(), twist_out_.data(), w_.data(), &status_},
          optional(warm_start_), stepping_,    options_};
}

template <class Real>
Offset Piece<Real>::ghosts() const {
  return static_cast<Offset>(std::count(is_owned_.begin(), is_owned_.end(), 0));
}

template <class Real>
std::vector<Real> Piece<Real>::answer(bool with_w) const {
  std::vector<Real> numbers;
  const auto append = [&](const std::vector<Real>& from, Offset row, Offset width) {
    numbers.insert(numbers.end(), from.begin() + row * width, from.begin() + (row + 1) * width);
  };
  for (Offset p = 0; p < contacts(); ++p) {
    if (visitors_.home(positions_[at(p)]) != rank_) continue;
    append(impulse_, p, 3);
    if (with_w) append(w_, p, 3);
  }
  for (Offset body = 0; body < bodies(); ++body)
    if (is_owned_[at(body)] != 0) append(twist_out_, body, 6);
  return numbers;
}

std::size_t answer_size(const BodyPlanData& plan, Offset env, const Visitors& visitors, std::span<const int> owner,
                        int rank, bool with_w) {
  std::size_t size = 0;
  for_each_home(EnvPlan(plan, env), visitors, rank, [&](Index) { size += with_w ? 6 : 3; });
  return size + 6 * static_cast<std::size_t>(std::count(owner.begin(), owner.end(), rank));
}

template <class Real>
void take_answer(const BodyBatchView<Real>& batch, const BodyPlanData& plan, Offset env, const Visitors& visitors,
                 std::span<const int> owner, int rank, std::span<const Real> answer,
                 const BodySolutionView<Real>& solution) {
  const EnvPlan own(plan, env);
  const Real* next = answer.data();
  const auto take = [&](Real* to, Offset row, Offset width) {
    std::copy(next, next + width, to + row * width);
    next += width;
  };
  for_each_home(own, visitors, rank, [&](Index p) {
    const Offset contact = batch.env_contact_offsets[env] + own.contact_order[p];
    take(solution.impulse, contact, 3);
    if (solution.w != nullptr) take(solution.w, contact, 3);
  });
  for (std::size_t body = 0; body < owner.size(); ++body)
    if (owner[body] == rank) take(solution.twist, batch.env_body_offsets[env] + static_cast<Offset>(body), 6);
}

template class Piece<float>;
template class Piece<double>;
template void take_answer(const BodyBatchView<float>&, const BodyPlanData&, Offset, const Visitors&,
                          std::span<const int>, int, std::span<const float>, const BodySolutionView<float>&);
template void take_answer(const BodyBatchView<double>&, const BodyPlanData&, Offset, const Visitors&,
                          std::span<const int>, int, std::span<const double>, const BodySolutionView<double>&);

}  // namespace stiction::distributed
