#include "distributed/program/rank_stepped_world.hpp"

#include <algorithm>
#include <optional>
#include <string>

#include "cli/step_monitor.hpp"
#include "distributed/program/deadline_guard.hpp"
#include "distributed/program/partition_option.hpp"
#include "distributed/program/peak_memory.hpp"
#include "distributed/program/shared_file.hpp"
#include "distributed/program/whole_checkpoint.hpp"
#include "distributed/transport/letters.hpp"
#include "stiction/hash.hpp"

namespace stiction::distributed {

namespace {

std::size_t at(Offset place) {
  return static_cast<std::size_t>(place);
}

/// Sums of all ranks, in their order.
WorldMotion sum_of(const std::vector<WorldMotion>& parts) {
  WorldMotion sum;
  for (const WorldMotion& part : parts) {
    sum.kinetic += part.kinetic;
    sum.potential += part.potential;
    for (int k = 0; k < 3; ++k) {
      sum.momentum[k] += part.momentum[k];
      sum.angular_momentum[k] += part.angular_momentum[k];
    }
  }
  return sum;
}

template <class Real>
BodyNumbers<Real> row_of(const WorldCheckpoint<Real>& from, Offset place) {
  BodyNumbers<Real> numbers;
  for_each_number(
      [&](std::size_t width, auto& to, const auto& all) {
        std::copy_n(all.begin() + static_cast<std::ptrdiff_t>(width) * place, width, to);
      },
      numbers, from);
  return numbers;
}

}  // namespace

template <class Real>
RankSteppedWorld<Real>::RankSteppedWorld(Transport& transport, const StepJobArguments& arguments,
                                         const scenes::WorldScene& scene, const WorldOptions& options)
    : transport_(transport),
      arguments_(arguments),
      options_(options),
      whole_(scene.description, options),
      checkpoint_(arguments.step, options),
      is_in_parts_(arguments.checkpoint_files.empty() ? !has_shared_files() : arguments.checkpoint_files == "parts") {
  const std::optional<std::uint64_t> seed = partition_seed(arguments.partition);
  for (Offset env = 0; env < arguments.step.environments; ++env)
    worlds_.push_back(std::make_unique<World>(transport, whole_.view(), options_, seed));
}

/// Puts an environment where its scene begins. Every rank makes the start of all bodies, and keeps its share.
template <class Real>
void RankSteppedWorld<Real>::start(Offset env) {
  const cli::StepArguments& step = arguments_.step;
  const scenes::WorldStart start =
      scenes::start_world(step.scene, step.seed, static_cast<std::uint64_t>(env), step.size);
  World& world = *worlds_[at(env)];
  const auto row = [&]<std::size_t kWidth>(const std::vector<double>& all, Index body, std::array<Real, kWidth>& to) {
    for (std::size_t k = 0; k < kWidth; ++k) to[k] = static_cast<Real>(all[kWidth * at(body) + k]);
  };
  BodyList<Real> bodies;
  for (Index body = world.first_share().first; body < world.first_share().end; ++body) {
    std::array<Real, 3> position;
    std::array<Real, 4> orientation;
    std::array<Real, 6> twist;
    row(start.position, body, position);
    row(start.orientation, body, orientation);
    row(start.twist, body, twist);
    bodies.add(body, numbers_at(std::span<const Real, 3>(position), std::span<const Real, 4>(orientation),
                                std::span<const Real, 6>(twist)));
  }
  world.put(std::move(bodies));
}

template <class Real>
std::int64_t RankSteppedWorld<Real>::resume() {
  const BodyRange share = share_of(whole_.view().bodies, transport_.rank(), transport_.size());
  const std::optional<io::CheckpointShare> file = checkpoint_.read({share.first, share.end});
  const std::int64_t done = file ? file->file.step : 0;
  for (const std::int64_t other : gather(transport_, done))
    if (other != done)
      throw Error(ErrorCode::bad_file, "--checkpoint: ranks have files of different steps; name a file that all see");
  for (Offset env = 0; env < arguments_.step.environments; ++env) {
    if (file) {
      go_on(env, share, *file);
    } else {
      start(env);
    }
  }
  states_ = std::make_unique<RankStateFile>(transport_, arguments_.step.output, cli::kStateHeader);
  return done;
}

/// Puts an environment where a file has it.
template <class Real>
void RankSteppedWorld<Real>::go_on(Offset env, const BodyRange& share, const io::CheckpointShare& file) {
  if (file.bodies.first != share.first || file.bodies.end != share.end)
    throw Error(ErrorCode::bad_file, "--checkpoint: the file has other bodies than the scene; choose another file");
  World& world = *worlds_[at(env)];
  const WorldCheckpoint<Real> from = cli::converted<Real>(file.file.world);
  BodyList<Real> bodies;
  for (Index body = share.first; body < share.end; ++body)
    bodies.add(body, row_of(from, env * (share.end - share.first) + body - share.first));
  Impulses<Real> last;
  for (Offset c = from.contact_offsets[at(env)]; c < from.contact_offsets[at(env) + 1]; ++c) {
    const std::uint64_t id = from.contact_id[at(c)];
    if (!world.has_pair(id))
      throw Error(ErrorCode::bad_file, "--checkpoint: contact_id = " + std::to_string(id) +
                                           " is of no pair of shapes of the scene; choose another file");
    const ShapePair pair = world.pair_of(id);
    if (!share.has(pair.body_a) && !share.has(pair.body_b)) continue;
    last.id.push_back(id);
    for (Offset k = 0; k < 3; ++k) last.impulse.push_back(from.impulse[at(3 * c + k)]);
  }
  world.put(std::move(bodies), std::move(last));
}

template <class Real>
void RankSteppedWorld<Real>::step() {
  for (const auto& world : worlds_) world->step();
}

template <class Real>
std::vector<WorldMotion> RankSteppedWorld<Real>::motion() {
  std::vector<WorldMotion> all;
  for (const auto& world : worlds_) all.push_back(sum_of(gather(transport_, world->motion())));
  return all;
}

template <class Real>
std::vector<cli::EnvSeen> RankSteppedWorld<Real>::see() {
  std::vector<cli::EnvSeen> all;
  for (const auto& world : worlds_) {
    const StepPiece<Real>& piece = *world->piece();
    const BodyBatchView<Real> contacts = piece.batch();
    const std::span<const Real> impulses(piece.contacts().impulse);
    cli::EnvSeen own{world->motion(), world->status(), cli::push_of_world(contacts, impulses, 0), 0,
                     cli::deepest_of(contacts, 0)};
    for (Offset c = 0; c < contacts.contact_count; ++c) own.contacts += piece.is_home(c) ? 1 : 0;
    const std::vector<cli::EnvSeen> parts = gather(transport_, own);
    std::vector<WorldMotion> motion;
    cli::EnvSeen sum;
    sum.status = own.status;
    for (const cli::EnvSeen& part : parts) {
      motion.push_back(part.motion);
      for (std::size_t k = 0; k < 3; ++k) sum.push[k] += part.push[k];
      sum.contacts += part.contacts;
      sum.deepest = std::max(sum.deepest, part.deepest);
    }
    sum.motion = sum_of(motion);
    all.push_back(sum);
  }
  return all;
}

/// Bodies go to the ranks that numbers alone give them to, with impulses of their contacts if those are asked for.
template <class Real>
BodyList<Real> RankSteppedWorld<Real>::by_number(const World& world, Impulses<Real>* impulses) const {
  const auto rank_of = [&](Index body) {
    return static_cast<std::size_t>(rank_with(body, whole_.view().bodies, transport_.size()));
  };
  std::vector<Letter> letters(at(transport_.size()));
  std::vector<std::uint32_t> counts(letters.size(), 0);
  for (const Index body : world.bodies().body) ++counts[rank_of(body)];
  for (std::size_t rank = 0; rank < letters.size(); ++rank) letters[rank].put(counts[rank]);
  for (std::size_t k = 0; k < world.bodies().size(); ++k) {
    Letter& letter = letters[rank_of(world.bodies().body[k])];
    letter.put(world.bodies().body[k]);
    letter.put(world.bodies().numbers[k]);
  }
  for (std::size_t c = 0; impulses != nullptr && c < world.impulses().id.size(); ++c) {
    const std::uint64_t id = world.impulses().id[c];
    const ShapePair pair = world.pair_of(id);
    const std::size_t second = rank_of(pair.body_b), first = pair.body_a < 0 ? second : rank_of(pair.body_a);
    for (const std::size_t rank : {first, second}) {
      letters[rank].put(id);
      for (std::size_t k = 0; k < 3; ++k) letters[rank].put(world.impulses().impulse[3 * c + k]);
      if (first == second) break;
    }
  }
  const BodyRange share = world.first_share();
  BodyList<Real> bodies;
  bodies.body.resize(at(share.end - share.first));
  bodies.numbers.resize(bodies.body.size());
  Impulses<Real> last;
  for (Letter& letter : exchange_with_all(transport_, letters)) {
    for (auto count = letter.template take<std::uint32_t>(); count > 0; --count) {
      const auto body = letter.template take<Index>();
      bodies.body[at(body - share.first)] = body;
      bodies.numbers[at(body - share.first)] = letter.template take<BodyNumbers<Real>>();
    }
    while (!letter.at_end()) {
      last.id.push_back(letter.template take<std::uint64_t>());
      for (std::size_t k = 0; k < 3; ++k) last.impulse.push_back(letter.template take<Real>());
    }
  }
  if (impulses != nullptr) *impulses = sorted(last);
  return bodies;
}

template <class Real>
void RankSteppedWorld<Real>::write_states(std::int64_t step) {
  if (!states_->is_open()) return;
  for (Offset env = 0; env < arguments_.step.environments; ++env) {
    const BodyList<Real> bodies = by_number(*worlds_[at(env)], nullptr);
    std::string text;
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      const BodyNumbers<Real>& of = bodies.numbers[k];
      text += cli::state_line<Real>(step, env, bodies.body[k], {of.position, of.orientation, of.twist});
    }
    states_->append(text);
  }
}

template <class Real>
void RankSteppedWorld<Real>::close_states() {
  states_->close();
}

/// The bodies of this rank by number, with their contacts.
template <class Real>
WorldCheckpoint<Real> RankSteppedWorld<Real>::part_by_number() const {
  WorldCheckpoint<Real> part;
  part.contact_offsets = {0};
  for (const auto& world : worlds_) {
    Impulses<Real> last;
    const BodyList<Real> bodies = by_number(*world, &last);
    for (const BodyNumbers<Real>& numbers : bodies.numbers)
      for_each_number([](std::size_t width, const auto& from,
                         auto& to) { to.insert(to.end(), std::begin(from), std::begin(from) + width); },
                      numbers, part);
    part.contact_id.insert(part.contact_id.end(), last.id.begin(), last.id.end());
    part.impulse.insert(part.impulse.end(), last.impulse.begin(), last.impulse.end());
    part.contact_offsets.push_back(static_cast<Offset>(part.contact_id.size()));
  }
  return part;
}

template <class Real>
void RankSteppedWorld<Real>::write_checkpoint(std::int64_t step) {
  if (!checkpoint_.is_due(step)) return;
  const std::filesystem::path& path = *checkpoint_.path();
  const io::CheckpointFile file = checkpoint_.file_of(step, part_by_number());
  if (transport_.size() == 1) return io::write_checkpoint(path, file);
  if (!is_in_parts_) {
    const DeadlineGuard guard(transport_.rank(), arguments_.deadline, "all write a checkpoint");
    return write_whole_checkpoint(transport_, path, file,
                                  share_of(whole_.view().bodies, transport_.rank(), transport_.size()),
                                  whole_.view().bodies);
  }
  write_checkpoint_part(path, file);
}

/// They are a checkpoint once rank 0 has named them.
template <class Real>
void RankSteppedWorld<Real>::write_checkpoint_part(const std::filesystem::path& path, const io::CheckpointFile& file) {
  const std::int64_t step = file.step;
  const std::filesystem::path name = io::checkpoint_part(path, step, transport_.rank(), transport_.size());
  io::CheckpointParts parts{file.run, step, {}, gather(transport_, io::write_checkpoint_part(name, file))};
  for (int rank = 0; rank <= transport_.size(); ++rank)
    parts.body_offsets.push_back(share_of(whole_.view().bodies, rank, transport_.size()).first);
  if (transport_.rank() == 0) io::write_checkpoint_parts(path, parts);
  static_cast<void>(gather(transport_, char{0}));  // the next part waits until this one is named
}

template <class Real>
WorldSeconds RankSteppedWorld<Real>::seconds() {
  WorldSeconds sum;
  for (const auto& world : worlds_) {
    const WorldSeconds& own = world->step_traffic().seconds;
    sum.detect += own.detect;
    sum.plan += own.plan;
    sum.solve += world->solve_report().seconds;
    sum.integrate += own.integrate;
  }
  return sum;
}

template <class Real>
std::uint64_t RankSteppedWorld<Real>::hash() {
  const auto envs = static_cast<Offset>(worlds_.size());
  const Offset hashed = arguments_.step.hashed.value_or(envs);
  const Offset bodies = hashed * whole_.view().bodies;
  std::uint64_t sum = 0;
  for (Offset env = 0; env < hashed; ++env) {
    const BodyList<Real>& own = worlds_[at(env)]->bodies();
    for (std::size_t k = 0; k < own.size(); ++k) {
      const Offset place = env * whole_.view().bodies + own.body[k];
      const auto add = [&](std::span<const Real> numbers, Offset before) {
        const Offset first = before * bodies + static_cast<Offset>(numbers.size()) * place;
        sum += hash_part(numbers, static_cast<std::uint64_t>(first));
      };
      add(own.numbers[k].position, 0);
      add(own.numbers[k].orientation, 3);
      add(own.numbers[k].twist, 7);
    }
  }
  std::uint64_t all = 0;
  for (const std::uint64_t part : gather(transport_, sum)) all += part;
  return all;
}

template <class Real>
std::vector<StepRankReport> RankSteppedWorld<Real>::reports() {
  StepRankReport own;
  for (const auto& world : worlds_) {
    add(own.solve, world->solve_report());
    add(own.rest, world->step_traffic());
  }
  own.peak_memory = peak_memory();
  return gather(transport_, own);
}

template class RankSteppedWorld<float>;
template class RankSteppedWorld<double>;

}  // namespace stiction::distributed
