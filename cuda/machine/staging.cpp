#include "cuda/machine/staging.hpp"

#include <algorithm>
#include <cstring>
#include <functional>

#include "core/job/row_numbers.hpp"
#include "cuda/machine/stream_timer.hpp"
#include "stiction/error.hpp"
#include "stiction/trace.hpp"

namespace stiction::cuda {

namespace {

/// The arrays of environments [first, last) of a host batch, counted from the first one's zero, laid out in one block
/// of memory.
template <class Real>
class Piece {
 public:
  Piece(const ContactBatchView<Real>& all, const Real* first_guess, Offset first, Offset last) : view(all) {
    const Offset row = all.env_row_offsets[first], cone = all.env_cone_offsets[first], entry = all.row_offsets[row];
    const Offset envs = last - first;
    const Offset rows = all.env_row_offsets[last] - row, cones = all.env_cone_offsets[last] - cone;
    const Offset entries = all.row_offsets[row + rows] - entry;
    view.env_count = envs;
    view.row_count = rows;
    view.cone_count = cones;
    view.nonzero_count = entries;
    add(view.env_row_offsets, all.env_row_offsets + first, envs + 1, row);
    add(view.env_cone_offsets, all.env_cone_offsets + first, envs + 1, cone);
    add_optional(view.env_row_counts, all.env_row_counts, first, envs);
    add_optional(view.env_cone_counts, all.env_cone_counts, first, envs);
    add_optional(view.env_flags, all.env_flags, first, envs);
    add_optional(view.env_tolerance, all.env_tolerance, first, envs);
    add_optional(view.env_max_iterations, all.env_max_iterations, first, envs);
    add(view.cone_kind, all.cone_kind + cone, cones);
    add(view.cone_row_offsets, all.cone_row_offsets + cone, cones + 1, row);
    add_optional(view.cone_group, all.cone_group, cone, cones);
    add(view.row_offsets, all.row_offsets + row, rows + 1, entry);
    add_optional(view.row_counts, all.row_counts, row, rows);
    add_optional(view.column_offsets, all.column_offsets, row, rows);
    // Shared columns are addressed from the beginning of all of them.
    if (all.column_offsets != nullptr)
      add(view.column, all.column, all.column_count);
    else
      add(view.column, all.column + entry, entries);
    add(view.A, all.A + entry, entries);
    for (const auto member : kRowNumbers<Real>)
      if (member != &ContactBatchView<Real>::mu || all.mu_offsets == nullptr)
        add(view.*member, all.*member + row, rows);
    // Friction that rows share is addressed from the beginning of all of it, like shared columns.
    add_optional(view.mu_offsets, all.mu_offsets, row, rows);
    if (all.mu_offsets != nullptr) add(view.mu, all.mu, all.mu_count);
    if (all.factor_offsets != nullptr) {
      const Offset entry_of_factor = all.factor_offsets[first];
      view.factor_count = all.factor_offsets[last] - entry_of_factor;
      add(view.factor_offsets, all.factor_offsets + first, envs + 1, entry_of_factor);
      add(view.factor, all.factor + entry_of_factor, view.factor_count);
    }
    add_optional(warm_start, first_guess, row, rows);
    view.space = MemorySpace::cuda;
  }
  Piece(const Piece&) = delete;
  Piece& operator=(const Piece&) = delete;

  [[nodiscard]] std::size_t bytes() const { return arrays_.bytes(); }
  void write(std::byte* memory) {
    arrays_.place(memory);
    for (const auto& fill : fills_) fill();
  }
  void point_to(std::byte* memory) { arrays_.place(memory); }

  ContactBatchView<Real> view;
  const Real* warm_start = nullptr;

 private:
  template <class T>
  void add(const T*& target, const T* source, Offset count, T base = T{}) {
    arrays_.add(target, count);
    fills_.push_back([&target, source, count, base] {
      T* const out = const_cast<T*>(target);
      if constexpr (std::is_same_v<T, Offset>) {
        for (Offset i = 0; i < count; ++i) out[i] = source[i] - base;
      } else {
        std::copy_n(source, count, out);
      }
    });
  }
  template <class T>
  void add_optional(const T*& target, const T* source, Offset first, Offset count) {
    if (source != nullptr) add(target, source + first, count);
  }

  ArraySet arrays_;
  std::vector<std::function<void()>> fills_;
};

/// The answer of a whole batch in one block of memory.
template <class Real>
struct Answer {
  SolutionView<Real> view;
  ArraySet arrays;
  Answer(const ContactBatchView<Real>& batch, bool with_w) {
    arrays.add(view.lambda, batch.row_count);
    if (with_w) arrays.add(view.w, batch.row_count);
    arrays.add(view.status, batch.env_count);
  }
  Answer(const Answer&) = delete;
  Answer& operator=(const Answer&) = delete;
};

template <class MemoryType>
void grow(MemoryType& memory, DeviceApi& api, std::size_t bytes) {
  if (memory.bytes() < bytes) memory = MemoryType(api, bytes);
}

}  // namespace

Staging::Staging(DeviceApi& api, Engine& engine, Offset piece_bytes)
    : api_(api), engine_(engine), piece_bytes_(piece_bytes), up_(api), compute_(api), down_(api) {
  for (Buffer& buffer : buffer_) {
    buffer.uploaded = std::make_unique<Event>(api);
    buffer.solved = std::make_unique<Event>(api);
  }
}

Staging::~Staging() {
  finish();
}

void Staging::finish() noexcept {
  try {
    for (const Stream* stream : {&up_, &compute_, &down_}) api_.synchronize(stream->get());
  } catch (const Error&) {
    return;
  }
}

/// Returns the start of each piece, closed by the number of environments.
template <class Real>
std::vector<Offset> Staging::cut(const SolveRequest<Real>& request) const {
  const ContactBatchView<Real>& batch = request.batch;
  std::vector<Offset> cuts{0};
  Offset bytes = 0;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset row = batch.env_row_offsets[env], end = batch.env_row_offsets[env + 1];
    constexpr Offset kBytesOfEntry = sizeof(Real) + sizeof(Index);
    const Offset own = (batch.row_offsets[end] - batch.row_offsets[row]) * kBytesOfEntry +
                       Offset{batch.env_dofs(env)} * (end - row) * Offset{sizeof(Real)};
    if (bytes > 0 && bytes + own > piece_bytes_) {
      cuts.push_back(env);
      bytes = 0;
    }
    bytes += own;
  }
  cuts.push_back(batch.env_count);
  return cuts;
}

template <class Real>
void Staging::queue_pieces(const SolveRequest<Real>& request, const std::vector<Offset>& cuts) {
  const ContactBatchView<Real>& batch = request.batch;
  Tracer* const tracer = request.options.tracer;
  StreamTimer& timer = engine_.timer();
  timer.attach(tracer, false);
  Answer<Real> host(batch, request.solution.w != nullptr), device(batch, request.solution.w != nullptr);
  grow(answer_host_, api_, host.arrays.bytes());
  grow(answer_device_, api_, device.arrays.bytes());
  host.arrays.place(answer_host_.get());
  device.arrays.place(answer_device_.get());

  for (std::size_t k = 0; k + 1 < cuts.size(); ++k) {
    Buffer& buffer = buffer_[k % 2];
    if (k >= 2) api_.await(buffer.uploaded->get());
    Piece<Real> piece(batch, request.warm_start, cuts[k], cuts[k + 1]);
    if (buffer.device.bytes() < piece.bytes()) {
      api_.synchronize(compute_.get());
      grow(buffer.device, api_, piece.bytes());
      grow(buffer.host, api_, piece.bytes());
    }
    {
      const ScopedSpan span(tracer, "stage", "piece", 0, cuts[k + 1] - cuts[k]);
      const ProfilerRange range(api_, "stage");
      piece.write(buffer.host.get());
    }
    api_.wait(up_.get(), buffer.solved->get());
    timer.time("upload", "piece", kUploadLane, up_.get(), [&] {
      api_.copy(buffer.device.get(), buffer.host.get(), piece.bytes(), CopyKind::to_device, up_.get());
    });
    api_.record(buffer.uploaded->get(), up_.get());

    piece.point_to(buffer.device.get());
    const Offset row = batch.env_row_offsets[cuts[k]], env = cuts[k];
    const SolutionView<Real> part{device.view.lambda + row, device.view.w == nullptr ? nullptr : device.view.w + row,
                                  device.view.status + env};
    api_.wait(compute_.get(), buffer.uploaded->get());
    engine_.solve(SolveRequest<Real>{nullptr, piece.view, part, piece.warm_start, request.law, request.options,
                                     StreamRef(compute_.get())});
    api_.record(buffer.solved->get(), compute_.get());

    api_.wait(down_.get(), buffer.solved->get());
    const auto fetch = [&](auto* target, const auto* source, Offset count) {
      if (target == nullptr || count == 0) return;
      api_.copy(target, source, static_cast<std::size_t>(count) * sizeof(*target), CopyKind::to_host, down_.get());
    };
    timer.time("download", "piece", kDownloadLane, down_.get(), [&] {
      fetch(host.view.lambda + row, part.lambda, piece.view.row_count);
      if (part.w != nullptr) fetch(host.view.w + row, part.w, piece.view.row_count);
      fetch(host.view.status + env, part.status, piece.view.env_count);
    });
  }
  api_.synchronize(down_.get());
  timer.collect();
  // Row by row in use: numbers between them are the caller's.
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset row = batch.env_row_offsets[env];
    std::copy_n(host.view.lambda + row, batch.env_rows(env), request.solution.lambda + row);
    if (request.solution.w != nullptr) std::copy_n(host.view.w + row, batch.env_rows(env), request.solution.w + row);
  }
  std::copy_n(host.view.status, batch.env_count, request.solution.status);
}

template <class Real>
void Staging::solve(const SolveRequest<Real>& request) {
  if (request.batch.env_count == 0) return;
  try {
    queue_pieces(request, cut(request));
  } catch (...) {
    finish();
    throw;
  }
}

template void Staging::solve(const SolveRequest<float>&);
template void Staging::solve(const SolveRequest<double>&);

}  // namespace stiction::cuda
