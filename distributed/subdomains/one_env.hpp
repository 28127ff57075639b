#pragma once

#include "stiction/bodies.hpp"

namespace stiction::distributed {

/// One environment of a batch as a batch of its own.
template <class Real>
struct OneEnv {
  Offset body_offsets[2], contact_offsets[2];
  BodyBatchView<Real> view;
  BodySolutionView<Real> solution;
  const Real* warm_start;

  OneEnv(const BodyBatchView<Real>& batch, const BodySolutionView<Real>& all, const Real* warm, Offset env) {
    const Offset body = batch.env_body_offsets[env], contact = batch.env_contact_offsets[env];
    const auto from = [](auto* array, Offset row) { return array == nullptr ? nullptr : array + row; };
    view = batch;
    view.env_count = 1;
    view.body_count = batch.env_body_offsets[env + 1] - body;
    view.contact_count = batch.env_contact_offsets[env + 1] - contact;
    body_offsets[0] = contact_offsets[0] = 0;
    body_offsets[1] = view.body_count;
    contact_offsets[1] = view.contact_count;
    view.env_body_offsets = body_offsets;
    view.env_contact_offsets = contact_offsets;
    view.inv_mass = from(batch.inv_mass, body);
    view.inv_inertia = from(batch.inv_inertia, 6 * body);
    view.twist = from(batch.twist, 6 * body);
    view.twist_change = from(batch.twist_change, 6 * body);
    view.kinematic = from(batch.kinematic, body);
    view.body_a = from(batch.body_a, contact);
    view.body_b = from(batch.body_b, contact);
    view.arm_a = from(batch.arm_a, 3 * contact);
    view.arm_b = from(batch.arm_b, 3 * contact);
    view.normal = from(batch.normal, 3 * contact);
    view.mu = from(batch.mu, contact);
    view.depth = from(batch.depth, contact);
    view.restitution = from(batch.restitution, contact);
    view.contact_id = nullptr;
    warm_start = from(warm, 3 * contact);
    solution = {from(all.impulse, 3 * contact), from(all.twist, 6 * body), from(all.w, 3 * contact),
                from(all.status, env)};
  }
  OneEnv(const OneEnv&) = delete;
  OneEnv& operator=(const OneEnv&) = delete;
};

}  // namespace stiction::distributed
