#pragma once

#include "stiction/batch_arrays.hpp"

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
    const auto move_by = [](Offset rows) {
      return [rows](const BatchArray& what, auto*& array) {
        if (array != nullptr) array += what.width * rows;
      };
    };
    for_each_body_array(view.body_count, move_by(body), view);
    for_each_contact_array(view.contact_count, move_by(contact), view);
    view.contact_id = nullptr;
    warm_start = from(warm, 3 * contact);
    solution = {from(all.impulse, 3 * contact), from(all.twist, 6 * body), from(all.w, 3 * contact),
                from(all.status, env)};
  }
  OneEnv(const OneEnv&) = delete;
  OneEnv& operator=(const OneEnv&) = delete;
};

}  // namespace stiction::distributed
