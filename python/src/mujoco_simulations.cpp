#include "python/src/mujoco_simulations.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

#include "cpu_fallback/threads/thread_pool.hpp"
#include "stiction/error.hpp"

namespace stiction::python {

namespace {

/// Bytes of the simulations of a chunk. A core's second cache holds about the memory that 16 humanoids touch in a
/// step; 64 took up to 1.4 times as long for each. Smaller ones share packs with more of their kind.
constexpr std::size_t kChunkBytes = std::size_t{1} << 19;
constexpr std::size_t kPack = 16,
                      kLargestChunk = 64;  ///< chunks are of so many simulations each, or of several times that

std::size_t simulations_of_a_chunk(std::size_t bytes) {
  return std::clamp(kChunkBytes / std::max(bytes, std::size_t{1}) / kPack * kPack, kPack, kLargestChunk);
}

/// Steps that a chunk takes before the next one begins, at most: all chunks are as far between them.
constexpr int kSteps = 16;

/// Adds up wall-clock seconds of parts of a step.
class Watch {
 public:
  explicit Watch(std::array<double, 4>& seconds) : seconds_(seconds) {}
  /// Adds the time since the last call to this part.
  void was(std::size_t part) {
    const Clock::time_point now = Clock::now();
    seconds_[part] += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::array<double, 4>& seconds_;
  Clock::time_point last_ = Clock::now();
};

}  // namespace

MujocoSimulations::MujocoSimulations(MujocoLayout layout, MujocoFunctions functions, const void* model,
                                     const std::vector<void*>& data, const SolverOptions& options, double warm_start)
    : layout_(std::move(layout)), threads_(cpu::thread_count(options.threads)) {
  const auto threads = static_cast<std::size_t>(threads_);
  chunk_size_ = std::clamp((data.size() + threads - 1) / threads, std::size_t{1},
                           simulations_of_a_chunk(layout_.simulation_bytes));
  const std::size_t chunks = (data.size() + chunk_size_ - 1) / chunk_size_;
  SolverOptions own = options;
  if (chunks > 1) own.threads = 1;  // threads share chunks
  for (std::size_t begin = 0; begin < data.size(); begin += chunk_size_) {
    const std::size_t end = std::min(begin + chunk_size_, data.size());
    std::vector<void*> part(data.begin() + static_cast<std::ptrdiff_t>(begin),
                            data.begin() + static_cast<std::ptrdiff_t>(end));
    chunks_.push_back(
        std::make_unique<MujocoChunk>(layout_, functions, model, std::move(part), begin, own, warm_start));
  }
  records_.resize(chunks);
  for (std::size_t worker = 0; worker < std::min(threads, chunks); ++worker)
    solvers_.emplace_back(Device::cpu(), own, JacobianCapacity{});
}

void MujocoSimulations::replace(std::size_t simulation, void* data) {
  const std::lock_guard lock(mutex_);
  chunks_[simulation / chunk_size_]->replace(simulation % chunk_size_, data);
}

void MujocoSimulations::configure(double timestep, bool sparse) {
  const std::lock_guard lock(mutex_);
  layout_.timestep = timestep;
  layout_.sparse = sparse;
}

void MujocoSimulations::activate(const std::vector<std::uint8_t>& active) {
  const std::lock_guard lock(mutex_);
  std::size_t size = 0;
  for (const auto& chunk : chunks_) size += chunk->size();
  if (active.size() != size)
    throw Error(ErrorCode::invalid_argument, "active has " + std::to_string(active.size()) + " entries for " +
                                                 std::to_string(size) + " simulations");
  for (std::size_t i = 0; i < chunks_.size(); ++i) chunks_[i]->activate(active.data() + i * chunk_size_);
}

void MujocoSimulations::limit(std::vector<double> tolerance, std::vector<Index> max_iterations) {
  const std::lock_guard lock(mutex_);
  tolerance_ = std::move(tolerance);
  max_iterations_ = std::move(max_iterations);
}

template <class Work>
void MujocoSimulations::each_chunk(const Work& work) {
  cpu::parallel_for(static_cast<int>(solvers_.size()), static_cast<int>(chunks_.size()),
                    [&](int item, int worker) { work(static_cast<std::size_t>(item), worker); });
}

void MujocoSimulations::solve(std::size_t chunk, int worker) {
  const std::size_t first = chunk * chunk_size_;
  chunks_[chunk]->solve(solvers_[static_cast<std::size_t>(worker)],
                        tolerance_.empty() ? nullptr : tolerance_.data() + first,
                        max_iterations_.empty() ? nullptr : max_iterations_.data() + first);
  const std::vector<EnvStatus>& found = chunks_[chunk]->system().status;
  records_[chunk].insert(records_[chunk].end(), found.begin(), found.end());
}

void MujocoSimulations::step_chunk(std::size_t chunk, int worker, const std::vector<MujocoSolve>& solves, int count,
                                   std::array<double, 4>& seconds) {
  MujocoChunk& own = *chunks_[chunk];
  Watch watch(seconds);
  for (int step = 0; step < count; ++step)
    for (const MujocoSolve& one : solves) {
      own.run(one.before);
      watch.was(0);
      if (one.constraint != nullptr) {
        own.run({{one.constraint}});
      } else {
        own.gather(Rowless::left_out);
        watch.was(1);
        solve(chunk, worker);
      }
      watch.was(2);
      own.run(one.after);
      watch.was(3);
    }
}

std::array<double, 4> MujocoSimulations::step(const std::vector<MujocoSolve>& solves, int count,
                                              const std::function<void()>& between) {
  const std::lock_guard lock(mutex_);
  std::vector<std::array<double, 4>> seconds(chunks_.size());
  std::array<double, 4> sum{};
  const auto start = std::chrono::steady_clock::now();
  try {
    for (int done = 0, steps = 0; done < count; done += steps) {
      if (done > 0) between();
      steps = std::min(kSteps, count - done);
      each_chunk([&](std::size_t i, int worker) { step_chunk(i, worker, solves, steps, seconds[i]); });
    }
  } catch (...) {
    for (std::vector<EnvStatus>& records : records_) records.clear();
    throw;
  }
  const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  double all = 0.0;
  for (const auto& parts : seconds)
    for (std::size_t part = 0; part < sum.size(); ++part) {
      sum[part] += parts[part];
      all += parts[part];
    }
  for (double& part : sum) part *= all > 0.0 ? wall / all : 0.0;
  return sum;
}

void MujocoSimulations::run(const std::vector<MujocoStage>& stages) {
  const std::lock_guard lock(mutex_);
  each_chunk([&](std::size_t i, int) { chunks_[i]->run(stages); });
}

void MujocoSimulations::gather(Rowless rowless) {
  const std::lock_guard lock(mutex_);
  each_chunk([&](std::size_t i, int) { chunks_[i]->gather(rowless); });
}

void MujocoSimulations::set_masses(const double* masses) {
  const std::lock_guard lock(mutex_);
  for (const auto& chunk : chunks_) masses = chunk->set_masses(masses);
}

void MujocoSimulations::solve() {
  const std::lock_guard lock(mutex_);
  each_chunk([&](std::size_t i, int worker) { solve(i, worker); });
}

void MujocoSimulations::write_controls(const double* controls) {
  const std::lock_guard lock(mutex_);
  const std::size_t width = chunk_size_ * static_cast<std::size_t>(layout_.nu);
  for (std::size_t i = 0; i < chunks_.size(); ++i) chunks_[i]->write_controls(controls + i * width);
}

void MujocoSimulations::read(std::size_t offset, std::size_t width, double* to) const {
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < chunks_.size(); ++i) chunks_[i]->read(offset, width, to + i * chunk_size_ * width);
}

void MujocoSimulations::reset_warm_start(const std::vector<Offset>& simulations) {
  const std::lock_guard lock(mutex_);
  std::size_t size = 0;
  for (const auto& chunk : chunks_) size += chunk->size();
  for (const Offset simulation : simulations)
    if (simulation < 0 || static_cast<std::size_t>(simulation) >= size)
      throw Error(ErrorCode::invalid_argument, "simulations: expected numbers in 0.." + std::to_string(size - 1) +
                                                   ", got " + std::to_string(simulation));
  for (const Offset simulation : simulations) {
    const auto env = static_cast<std::size_t>(simulation);
    chunks_[env / chunk_size_]->reset_warm_start(env % chunk_size_);
  }
}

MujocoSystem MujocoSimulations::system() const {
  const std::lock_guard lock(mutex_);
  MujocoSystem all(chunks_.front()->system().mass_form);
  for (const auto& chunk : chunks_) all.append(chunk->whole_system());
  return all;
}

std::vector<EnvStatus> MujocoSimulations::take_records() {
  const std::lock_guard lock(mutex_);
  std::vector<EnvStatus> all;
  for (std::vector<EnvStatus>& records : records_) {
    all.insert(all.end(), records.begin(), records.end());
    records.clear();
  }
  return all;
}

std::vector<EnvStatus> MujocoSimulations::status() const {
  const std::lock_guard lock(mutex_);
  std::vector<EnvStatus> all;
  for (const auto& chunk : chunks_) all.insert(all.end(), chunk->system().status.begin(), chunk->system().status.end());
  return all;
}

}  // namespace stiction::python
