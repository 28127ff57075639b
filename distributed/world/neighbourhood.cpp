#include "distributed/world/neighbourhood.hpp"

#include <algorithm>
#include <type_traits>

#include "core/job/shape_pairs.hpp"
#include "core/machine/world_machine.hpp"
#include "cpu_fallback/tables/isa.hpp"
#include "distributed/solve/scratch.hpp"
#include "distributed/transport/letters.hpp"
#include "distributed/world/body_boxes.hpp"
#include "distributed/world/world_kernels.hpp"

namespace stiction::distributed {

template <class Real>
NearBodies<Real> find_near_bodies(Transport& transport, const BodyList<Real>& own, PartOfWorld<Real>& part) {
  std::vector<BodyBox> boxes(own.size());
  find_body_boxes(part.arrays().job(), boxes);
  /// Reach of a rank's bodies.
  struct Reach {
    BodyBox box;
    std::int64_t bodies;
  };
  Reach all{{}, static_cast<std::int64_t>(own.size())};
  for (const BodyBox& box : boxes) all.box.add(box);
  const std::vector<Reach> of_rank = gather(transport, all);
  const auto rank = static_cast<std::size_t>(transport.rank());
  std::vector<Letter> letters(of_rank.size());
  for (std::size_t other = 0; other < of_rank.size(); ++other) {
    if (other == rank || !of_rank[other].box.overlaps(all.box)) continue;
    for (std::size_t k = 0; k < boxes.size(); ++k) {
      if (!boxes[k].overlaps(of_rank[other].box)) continue;
      letters[other].put(own.body[k]);
      letters[other].put(own.numbers[k]);
    }
  }
  letters = exchange_with_all(transport, letters);
  struct Source {
    Index body;
    int owner;
    BodyNumbers<Real> numbers;
  };
  std::vector<Source> sources;
  for (std::size_t k = 0; k < own.size(); ++k) sources.push_back({own.body[k], transport.rank(), own.numbers[k]});
  for (std::size_t other = 0; other < letters.size(); ++other)
    while (!letters[other].at_end()) {
      const auto body = letters[other].template take<Index>();
      sources.push_back({body, static_cast<int>(other), letters[other].template take<BodyNumbers<Real>>()});
    }
  std::sort(sources.begin(), sources.end(), [](const Source& a, const Source& b) { return a.body < b.body; });
  NearBodies<Real> near;
  for (const Reach& reach : of_rank) {
    near.all_bodies += reach.bodies;
    near.most_bodies = larger_of(near.most_bodies, Offset{reach.bodies});
  }
  for (const Source& source : sources) {
    near.list.add(source.body, source.numbers);
    near.owner.push_back(source.owner);
  }
  return near;
}

template <class Real>
StepPiece<Real>::StepPiece(const WorldModelView<Real>& whole, const NearBodies<Real>& near, int rank,
                           const Impulses<Real>& last, Real keep)
    : bodies_{near.list.body, near.owner, rank} {
  PartOfWorld<Real> part(whole, near.list);
  detect(whole, part, last, keep);
  choose_bodies(part.arrays());
}

/// Numbers of bodies in contacts_ are those of the near bodies.
template <class Real>
void StepPiece<Real>::detect(const WorldModelView<Real>& whole, PartOfWorld<Real>& part, const Impulses<Real>& last,
                             Real keep) {
  const cpu::WorldKernels<Real>& kernels = world_kernels<Real>();
  const WorldModel<Real>& model = part.model();
  const WorldJob<Real> job = part.arrays().job();
  Scratch<std::byte> workspace(kernels.workspace_bytes(job.model));
  const Offset near = kernels.count_near(job, 0, workspace.data());
  check_near_pairs(near, 0);
  Scratch<std::byte> pairs(kernels.pair_bytes(near));
  const Index count =
      kernels.find_contacts(job, 0, workspace.data(), static_cast<Index>(near), static_cast<void*>(pairs.data()));
  std::vector<FoundContact<Real>> found(at(count));
  kernels.list_contacts(job, 0, workspace.data(), static_cast<Index>(near), pairs.data(), found.data());

  // Pairs that push a body of this rank's, with the whole's number of their pair.
  std::vector<ShapePair> ends;
  std::size_t kept = 0;
  for (const FoundContact<Real>& contact : found) {
    const ShapePair pair = numbered_pair(job.model, contact.pair);
    const auto is_own = [&](Index body) { return body >= 0 && bodies_.owns(body); };
    if (!is_own(pair.body_a) && !is_own(pair.body_b)) continue;
    found[kept] = contact;
    found[kept++].pair =
        pair_number(whole, shape_pair(whole, model.described(pair.shape_a), model.described(pair.shape_b)));
    ends.push_back(pair);
  }
  contacts_.offsets = {0, static_cast<Offset>(kept)};
  contacts_.resize(static_cast<Offset>(kept));
  const std::vector<Offset> last_offsets{0, static_cast<Offset>(last.id.size())};
  ContactSink<Real> sink{contacts_.view(), {}, keep};
  // Remembered contacts are only read.
  std::vector<std::uint64_t> id = last.id;
  std::vector<Real> impulse = last.impulse;
  if (keep > 0) {
    sink.last.offsets = last_offsets.data();
    sink.last.id = id.data();
    sink.last.impulse = impulse.data();
  }
  WorldJob<Real> of_whole{};
  of_whole.model = whole;
  kernels.emit_contacts(of_whole, sink, 0, found.data());
  for (std::size_t c = 0; c < kept; ++c) {
    contacts_.body_a[c] = ends[c].body_a;
    contacts_.body_b[c] = ends[c].body_b;
  }
}

/// Leaves out ghosts that nothing pushes, and numbers the rest.
template <class Real>
void StepPiece<Real>::choose_bodies(const WorldArrays<Real>& from) {
  std::vector<Index> piece_body(bodies_.body.size(), -1);
  for (std::size_t k = 0; k < piece_body.size(); ++k)
    if (bodies_.owner[k] == bodies_.rank) piece_body[k] = 0;
  for (const std::vector<Index>* side : {&contacts_.body_a, &contacts_.body_b})
    for (const Index body : *side)
      if (body >= 0) piece_body[at(body)] = 0;
  const auto append = [](std::vector<Real>& to, const std::vector<Real>& rows, std::size_t k, std::size_t width) {
    for (std::size_t j = 0; j < width; ++j) to.push_back(rows[width * k + j]);
  };
  PieceBodies chosen;
  chosen.rank = bodies_.rank;
  for (std::size_t k = 0; k < piece_body.size(); ++k) {
    if (piece_body[k] < 0) continue;
    piece_body[k] = static_cast<Index>(chosen.body.size());
    chosen.body.push_back(bodies_.body[k]);
    chosen.owner.push_back(bodies_.owner[k]);
    append(inv_mass_, from.inv_mass, k, 1);
    append(inv_inertia_, from.inv_inertia, k, 6);
    append(twist_, from.twist, k, 6);
    append(twist_change_, from.twist_change, k, 6);
  }
  bodies_ = std::move(chosen);
  for (std::vector<Index>* side : {&contacts_.body_a, &contacts_.body_b})
    for (Index& body : *side)
      if (body >= 0) body = piece_body[at(body)];
  body_offsets_ = {0, static_cast<Offset>(bodies_.body.size())};
}

template <class Real>
Offset StepPiece<Real>::ghosts() const {
  return static_cast<Offset>(bodies_.owner.size()) -
         std::count(bodies_.owner.begin(), bodies_.owner.end(), bodies_.rank);
}

template <class Real>
BodyBatchView<Real> StepPiece<Real>::batch() const {
  BodyBatchView<Real> view;
  view.env_count = 1;
  view.body_count = body_offsets_.back();
  view.contact_count = contacts_.offsets.back();
  view.env_body_offsets = body_offsets_.data();
  view.env_contact_offsets = contacts_.offsets.data();
  view.inv_mass = inv_mass_.data();
  view.inv_inertia = inv_inertia_.data();
  view.twist = twist_.data();
  view.twist_change = twist_change_.data();
  view.body_a = contacts_.body_a.data();
  view.body_b = contacts_.body_b.data();
  view.arm_a = contacts_.arm_a.data();
  view.arm_b = contacts_.arm_b.data();
  view.normal = contacts_.normal.data();
  view.mu = contacts_.mu.data();
  view.depth = contacts_.depth.data();
  view.restitution = contacts_.restitution.data();
  view.contact_id = contacts_.id.data();
  return view;
}

template <class Real>
bool StepPiece<Real>::is_home(Offset contact) const {
  const Index low = contacts_.body_a[at(contact)];
  return bodies_.owns(low >= 0 ? low : contacts_.body_b[at(contact)]);
}

template NearBodies<float> find_near_bodies(Transport&, const BodyList<float>&, PartOfWorld<float>&);
template NearBodies<double> find_near_bodies(Transport&, const BodyList<double>&, PartOfWorld<double>&);
template class StepPiece<float>;
template class StepPiece<double>;

}  // namespace stiction::distributed
