#include "core/machine/world_arrays.hpp"

#include "core/base/extents.hpp"

namespace stiction {

template <class Real>
void HostContacts<Real>::resize(Offset count) {
  for_each_contact_array([&](Offset width, auto& array) { array.resize(at(width * count)); }, *this);
}

template <class Real>
WorldContacts<Real> HostContacts<Real>::view() {
  WorldContacts<Real> view{};
  view.offsets = offsets.data();
  for_each_contact_array([](Offset, auto*& pointer, auto& array) { pointer = array.data(); }, view, *this);
  return view;
}

template <class Real>
WorldArrays<Real>::WorldArrays(const WorldModelView<Real>& world, Offset envs)
    : model(world), env_count(envs), inv_mass(at(envs * world.bodies)), body_offsets(at(envs) + 1), status(at(envs)) {
  for_each_body_array([&](Offset width, auto& array) { array.assign(at(width * envs * model.bodies), Real(0)); },
                      *this);
  for (Offset env = 0; env <= envs; ++env) body_offsets[at(env)] = env * model.bodies;
  for (std::size_t place = 0; place < inv_mass.size(); ++place)
    inv_mass[place] = model.body[place % at(model.bodies)].inv_mass;
  contacts.offsets.assign(at(envs) + 1, 0);
}

template <class Real>
WorldJob<Real> WorldArrays<Real>::job() {
  WorldJob<Real> job{};
  job.model = model;
  for_each_body_array([](Offset, auto*& pointer, auto& array) { pointer = array.data(); }, job, *this);
  job.status = status.data();
  return job;
}

template <class Real>
BodyBatchView<Real> WorldArrays<Real>::batch() {
  return batch_of(job(), inv_mass.data(), body_offsets.data(), contacts.view(), env_count, contacts.offsets.back(),
                  MemorySpace::host);
}

template <class Real>
void WorldArrays<Real>::resume(const WorldCheckpoint<Real>& from) {
  position = from.position;
  orientation = from.orientation;
  twist = from.twist;
  wrench = from.wrench;
  status.assign(status.size(), EnvStatus{});
  contacts = {};
  contacts.offsets = from.contact_offsets;
  contacts.resize(from.contact_offsets.back());
  contacts.id = from.contact_id;
  contacts.impulse = from.impulse;
}

template <class Real>
BodyBatchView<Real> batch_of(const WorldJob<Real>& job, const Real* inv_mass, const Offset* body_offsets,
                             const WorldContacts<Real>& contacts, Offset env_count, Offset contact_count,
                             MemorySpace space) {
  BodyBatchView<Real> view;
  view.env_count = env_count;
  view.body_count = env_count * job.model.bodies;
  view.contact_count = contact_count;
  view.env_body_offsets = body_offsets;
  view.env_contact_offsets = contacts.offsets;
  view.inv_mass = inv_mass;
  view.inv_inertia = job.inv_inertia;
  view.twist = job.twist;
  view.twist_change = job.twist_change;
  view.body_a = contacts.body_a;
  view.body_b = contacts.body_b;
  view.arm_a = contacts.arm_a;
  view.arm_b = contacts.arm_b;
  view.normal = contacts.normal;
  view.mu = contacts.mu;
  view.depth = contacts.depth;
  view.restitution = contacts.restitution;
  view.contact_id = contacts.id;
  view.space = space;
  return view;
}

template struct HostContacts<float>;
template struct HostContacts<double>;
template struct WorldArrays<float>;
template struct WorldArrays<double>;
template BodyBatchView<float> batch_of(const WorldJob<float>&, const float*, const Offset*, const WorldContacts<float>&,
                                       Offset, Offset, MemorySpace);
template BodyBatchView<double> batch_of(const WorldJob<double>&, const double*, const Offset*,
                                        const WorldContacts<double>&, Offset, Offset, MemorySpace);

}  // namespace stiction
