#include "cuda/machine/world_machine.hpp"

#include <algorithm>
#include <utility>

#include "core/base/extents.hpp"
#include "core/base/runs.hpp"
#include "cuda/api/mover.hpp"
#include "cuda/kernels/world_program.hpp"

namespace stiction {

namespace cuda {

namespace {

/// Most device memory for the scratch of all teams that find contacts, unless a single one needs more.
constexpr Offset kRoomBytes = Offset{1} << 28;
constexpr Offset kTeamsPerProcessor = 32;
/// Near pairs of a shape that there is room for at first, if they were shared out alike.
constexpr Offset kNearPerShape = 8;
/// Contacts of an environment that there is room for before any were found.
constexpr Index kFirstRoom = 16;

/// Lanes for that much to do in each environment. They reach speed only.
int lanes_for(Index items) {
  return items <= 8 ? 8 : items <= 16 ? 16 : kWarp;
}

/// Lanes for an environment with a tree over that many shapes: some shapes for each.
int lanes_of_tree(Index shapes) {
  int lanes = kWarp;
  while (lanes < kMostLanes && 4 * lanes < shapes) lanes *= 2;
  return lanes;
}

}  // namespace

template <class Real>
DeviceWorldMachine<Real>::DeviceWorldMachine(std::shared_ptr<DeviceApi> api, const WorldModelView<Real>& model,
                                             Offset env_count, const WorldOptions& options)
    : api_(std::move(api)),
      kernels_(api_->kernels().world[sizeof(Real) == sizeof(float) ? 0 : 1]),
      stream_(*api_),
      env_count_(env_count),
      keep_(static_cast<Real>(options.warm_start)),
      limited_(options.solver.max_contacts_per_env > 0),
      host_(model, env_count),
      counts_(at(env_count)) {
  make_workspaces(model.by_tree ? kNearPerShape * Offset{model.shapes} : 0);
  queue_all(*api_, stream_.get(), [&] {
    place_bodies();
    scan_offsets();
    api_->synchronize(stream_.get());
  });
}

template <class Real>
DeviceWorldMachine<Real>::~DeviceWorldMachine() {
  try {
    api_->synchronize(stream_.get());
  } catch (const Error&) {
    return;  // the device is lost, and nothing runs on it
  }
}

/// The model and everything that is there once per body or environment.
template <class Real>
void DeviceWorldMachine<Real>::place_bodies() {
  const WorldModelView<Real>& model = host_.model;
  const Offset bodies = env_count_ * model.bodies;
  job_.model = model;
  ArraySet set;
  set.add(job_.model.body, model.bodies);
  set.add(job_.model.shape, model.shapes);
  set.add(job_.model.shapes_of, model.bodies + 1);
  set.add(job_.model.pair, model.pairs);
  for_each_body_array([&](Offset width, auto*& array) { set.add(array, width * bodies); }, job_);
  set.add(job_.status, env_count_);
  set.add(inv_mass_, bodies);
  set.add(body_offsets_, env_count_ + 1);
  set.add(motion_, env_count_);
  set.add(count_, env_count_);
  set.add(near_, model.by_tree ? env_count_ : 0);
  set.add(now_.view.offsets, env_count_ + 1);
  set.add(next_.view.offsets, env_count_ + 1);
  bodies_ = DeviceMemory(*api_, set.bytes());
  set.place(bodies_.get());
  Mover mover(*api_, stream_.get());
  mover.to_device(job_.model.body, model.body, model.bodies);
  mover.to_device(job_.model.shape, model.shape, model.shapes);
  mover.to_device(job_.model.shapes_of, model.shapes_of, model.bodies + 1);
  mover.to_device(job_.model.pair, model.pair, model.pairs);
  for_each_body_array([&](Offset, auto* there,
                          const auto& here) { mover.to_device(there, here.data(), static_cast<Offset>(here.size())); },
                      job_, host_);
  mover.to_device(job_.status, host_.status.data(), env_count_);
  mover.to_device(inv_mass_, host_.inv_mass.data(), bodies);
  mover.to_device(body_offsets_, host_.body_offsets.data(), env_count_ + 1);
}

/// No contacts so far.
template <class Real>
void DeviceWorldMachine<Real>::scan_offsets() {
  Mover mover(*api_, stream_.get());
  for (const Contacts* contacts : {&now_, &next_})
    mover.to_device(contacts->view.offsets, host_.contacts.offsets.data(), env_count_ + 1);
}

template <class Real>
void DeviceWorldMachine<Real>::launch(const KernelRef& kernel, Offset teams, int lanes, const void* arguments) {
  LaunchShape shape;
  shape.teams = teams;
  shape.lanes = lanes;
  api_->launch(kernel, shape, arguments, stream_.get());
}

/// Memory for as many teams as are to run, each with room for so many near pairs.
template <class Real>
void DeviceWorldMachine<Real>::make_workspaces(Offset near) {
  const WorldModelView<Real>& model = host_.model;
  const Offset bytes = model.by_tree ? NearWorkspace<Real>::bytes(model) + NearPairs<Real>::bytes(near)
                                     : ListedPairs<Real>::bytes(model);
  workspace_bytes_ = static_cast<Offset>(padded_bytes(at(bytes)));
  const Offset fitting = larger_of<Offset>(1, kRoomBytes / larger_of<Offset>(1, workspace_bytes_));
  teams_ = smaller_of(env_count_, smaller_of(fitting, kTeamsPerProcessor * api_->facts().processors));
  near_room_ = near;
  workspace_.make_room(*api_, at(teams_ * workspace_bytes_));
}

template <class Real>
void DeviceWorldMachine<Real>::launch_find() {
  if (workspace_.get() == nullptr) make_workspaces(near_room_);  // an earlier step was refused the memory
  const WorldFindArgs<Real> args{
      job_,  env_count_, workspace_.get(), workspace_bytes_, reinterpret_cast<FoundContact<Real>*>(found_.get()),
      most_, count_};
  if (!job_.model.by_tree) return launch(kernels_.find, teams_, lanes_for(job_.model.pairs), &args);
  const WorldFindNearArgs<Real> near_args{args, near_room_, near_};
  launch(kernels_.find_near, teams_, lanes_of_tree(job_.model.shapes), &near_args);
}

/// Returns true if there was too little room for near pairs; there is enough afterwards.
template <class Real>
bool DeviceWorldMachine<Real>::lacked_near_pairs() {
  if (!job_.model.by_tree) return false;
  near_counts_.resize(at(env_count_));
  Mover(*api_, stream_.get()).to_host(near_counts_.data(), near_, env_count_);
  api_->synchronize(stream_.get());
  Offset largest = 0;
  for (Offset env = 0; env < env_count_; ++env) {
    check_near_pairs(near_counts_[at(env)], env);
    largest = larger_of(largest, near_counts_[at(env)]);
  }
  if (largest <= near_room_) return false;
  make_workspaces(smaller_of(largest + largest / 4, kMostNearPairs));
  return true;
}

/// Finds them again, with more room, where an environment has more than there was room for.
template <class Real>
void DeviceWorldMachine<Real>::count_contacts() {
  for (Index most = larger_of(most_, kFirstRoom);;) {
    if (most > most_) {
      found_.make_room(*api_, at(env_count_ * most) * sizeof(FoundContact<Real>));
      most_ = most;
    }
    launch_find();
    if (lacked_near_pairs()) continue;
    Mover(*api_, stream_.get()).to_host(counts_.data(), count_, env_count_);
    api_->synchronize(stream_.get());
    const Index largest = counts_.empty() ? 0 : *std::max_element(counts_.begin(), counts_.end());
    if (largest <= most_) return;
    most = largest + largest / 4;
  }
}

template <class Real>
void DeviceWorldMachine<Real>::make_room(Contacts& contacts, Offset count) {
  if (count <= contacts.room) return;
  const Offset room = count + (contacts.room > 0 ? count / 8 : 0);
  contacts.room = 0;
  ArraySet set;
  for_each_contact_array([&](Offset width, auto*& array) { set.add(array, width * room); }, contacts.view);
  contacts.memory.make_room(*api_, set.bytes());
  set.place(contacts.memory.get());
  contacts.room = room;
}

/// Returns the data that planning reads.
template <class Real>
void DeviceWorldMachine<Real>::fetch_structure() {
  const Offset count = host_.contacts.offsets.back();
  Mover mover(*api_, stream_.get());
  mover.to_host(host_.contacts.body_a.data(), now_.view.body_a, count);
  mover.to_host(host_.contacts.body_b.data(), now_.view.body_b, count);
  if (limited_) mover.to_host(host_.contacts.depth.data(), now_.view.depth, count);
  api_->synchronize(stream_.get());
}

template <class Real>
WorldSolve<Real> DeviceWorldMachine<Real>::find_contacts() {
  state_here_ = status_here_ = contacts_here_ = false;
  Mover mover(*api_, stream_.get());
  if (pushed_) mover.to_device(job_.wrench, host_.wrench.data(), static_cast<Offset>(host_.wrench.size()));
  count_contacts();
  std::vector<Offset>& offsets = host_.contacts.offsets;
  for (Offset env = 0; env < env_count_; ++env) offsets[at(env) + 1] = offsets[at(env)] + counts_[at(env)];
  const Offset count = offsets.back();
  host_.contacts.resize(count);
  make_room(next_, count);
  mover.to_device(next_.view.offsets, offsets.data(), env_count_ + 1);
  EmitWorldContactsArgs<Real> args{job_.model,
                                   {next_.view, now_.view, keep_},
                                   env_count_,
                                   reinterpret_cast<const FoundContact<Real>*>(found_.get()),
                                   most_};
  if (!(keep_ > 0)) args.sink.last.offsets = nullptr;
  launch(kernels_.emit_contacts, env_count_, lanes_for(most_), &args);
  std::swap(now_, next_);
  fetch_structure();
  const WorldContacts<Real>& now = now_.view;
  return {host_.batch(),
          batch_of(job_, inv_mass_, body_offsets_, now, env_count_, count, MemorySpace::cuda),
          {now.impulse, const_cast<Real*>(job_.solved_twist), nullptr, const_cast<EnvStatus*>(job_.status)},
          keep_ > 0 ? now.guess : nullptr,
          StreamRef(stream_.get())};
}

template <class Real>
void DeviceWorldMachine<Real>::await_solve() {
  api_->synchronize(stream_.get());
}

template <class Real>
void DeviceWorldMachine<Real>::integrate() {
  const WorldArgs<Real> args{job_, env_count_, nullptr};
  launch(kernels_.integrate, env_count_, lanes_for(job_.model.bodies), &args);
  api_->synchronize(stream_.get());
}

/// Everything that a batch shows.
template <class Real>
void DeviceWorldMachine<Real>::fetch_contacts() {
  const Offset count = host_.contacts.offsets.back();
  Mover mover(*api_, stream_.get());
  const auto bodies = static_cast<Offset>(host_.inv_mass.size());
  mover.to_host(host_.inv_inertia.data(), job_.inv_inertia, 6 * bodies);
  mover.to_host(host_.twist_change.data(), job_.twist_change, 6 * bodies);
  mover.to_host(host_.twist.data(), job_.twist, 6 * bodies);
  for_each_contact_array(
      [&](Offset width, auto& here, const auto* there) { mover.to_host(here.data(), there, width * count); },
      host_.contacts, now_.view);
}

template <class Real>
WorldArrays<Real>& DeviceWorldMachine<Real>::observe(WorldPart part) {
  bool& here = part == WorldPart::state ? state_here_ : part == WorldPart::status ? status_here_ : contacts_here_;
  if (here) return host_;
  Mover mover(*api_, stream_.get());
  const auto bodies = static_cast<Offset>(host_.inv_mass.size());
  switch (part) {
    case WorldPart::state:
      mover.to_host(host_.position.data(), job_.position, 3 * bodies);
      mover.to_host(host_.orientation.data(), job_.orientation, 4 * bodies);
      mover.to_host(host_.twist.data(), job_.twist, 6 * bodies);
      break;
    case WorldPart::status:
      mover.to_host(host_.status.data(), job_.status, env_count_);
      break;
    case WorldPart::contacts:
      fetch_contacts();
      break;
  }
  api_->synchronize(stream_.get());
  here = true;
  return host_;
}

template <class Real>
void DeviceWorldMachine<Real>::place_state() {
  Mover mover(*api_, stream_.get());
  const auto bodies = static_cast<Offset>(host_.inv_mass.size());
  mover.to_device(job_.position, host_.position.data(), 3 * bodies);
  mover.to_device(job_.orientation, host_.orientation.data(), 4 * bodies);
  mover.to_device(job_.twist, host_.twist.data(), 6 * bodies);
}

template <class Real>
void DeviceWorldMachine<Real>::restart(std::span<const std::uint8_t> mask) {
  place_state();
  const std::vector<Offset>& offsets = host_.contacts.offsets;
  for_each_run(mask, [&](std::size_t begin, std::size_t end) {
    const Offset first = offsets[begin], count = offsets[end] - first;
    if (count == 0) return;
    api_->fill_zero(now_.view.impulse + 3 * first, 3 * at(count) * sizeof(Real), stream_.get());
  });
  contacts_here_ = contacts_here_ && offsets.back() == 0;
  api_->synchronize(stream_.get());
}

template <class Real>
void DeviceWorldMachine<Real>::resume(const WorldCheckpoint<Real>& from) {
  host_.resume(from);
  place_state();
  const Offset count = host_.contacts.offsets.back();
  make_room(now_, count);
  Mover mover(*api_, stream_.get());
  mover.to_device(job_.status, host_.status.data(), env_count_);
  mover.to_device(now_.view.offsets, host_.contacts.offsets.data(), env_count_ + 1);
  mover.to_device(now_.view.id, host_.contacts.id.data(), count);
  mover.to_device(now_.view.impulse, host_.contacts.impulse.data(), 3 * count);
  api_->synchronize(stream_.get());
  state_here_ = status_here_ = contacts_here_ = true;
  pushed_ = true;
}

template <class Real>
std::span<Real> DeviceWorldMachine<Real>::wrench() {
  pushed_ = true;
  return host_.wrench;
}

template <class Real>
void DeviceWorldMachine<Real>::motion(std::span<WorldMotion> out) {
  const WorldArgs<Real> args{job_, env_count_, motion_};
  launch(kernels_.measure, env_count_, 1, &args);
  Mover(*api_, stream_.get()).to_host(out.data(), motion_, env_count_);
  api_->synchronize(stream_.get());
}

template class DeviceWorldMachine<float>;
template class DeviceWorldMachine<double>;

}  // namespace cuda

}  // namespace stiction
