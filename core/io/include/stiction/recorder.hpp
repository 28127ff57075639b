#pragma once

#include <filesystem>
#include <vector>

#include "stiction/io.hpp"
#include "stiction/solver.hpp"

namespace stiction::io {

enum class RecordWhen : std::uint8_t {
  failed = 0,  ///< environments that did not end as `solved`
  always = 1,
};

struct RecorderOptions {
  RecordWhen when = RecordWhen::failed;
  Offset max_environments = 256;  ///< that the file holds; further ones are counted and left out
  std::vector<bool> mask;         ///< whether an environment is considered, by its index; empty: all are
};

/// Writes environments of a running solver to a contact-batch file. With them goes the input of `stiction replay` for
/// the same bits (docs/howto/record_replay.md): options, warm start, and the lambda that was the answer. The file is
/// written anew whenever a solve added to it, so that it is there if the process ends badly.
class Recorder {
 public:
  /// \throws Error(invalid_argument) if max_environments < 1.
  explicit Recorder(std::filesystem::path path, RecorderOptions options = {});

  /// Examines a solve that was just done, with the batch, the answer and the warm start (may be null) it had, wherever
  /// they are. In device memory, it waits for the work queued on `stream`. Returns how many environments were added.
  /// \throws Error(invalid_argument) if the solver's options, law or precision are not those of the solves before, or
  /// the mask is shorter than the batch. Error(unsupported) for an environment kept as a factor; Error(io).
  template <class Real>
  Offset take(const Solver& solver, const ContactBatchView<Real>& batch, const SolutionView<Real>& solution,
              const Real* warm_start = nullptr, StreamRef stream = StreamRef::default_stream());

  /// As above, of a host batch of J and M and the reactions of its rows. The file also gets J, M, v_free and the
  /// target. form: jacobian, or bodies where the rows are those of a batch of bodies that `solver` was given.
  /// \throws Error(invalid_argument) as above, and for a batch in device memory; Error(io).
  template <class Real>
  Offset take(const Solver& solver, const JacobianBatchView<Real>& batch, const SolutionView<Real>& solution,
              const Real* warm_start = nullptr, RecordedForm form = RecordedForm::jacobian);

  /// Environments in the file.
  [[nodiscard]] Offset recorded() const noexcept { return recording_.batch.env_count(); }
  /// Environments that should have been recorded and found no room.
  [[nodiscard]] Offset left_out() const noexcept { return left_out_; }

 private:
  [[nodiscard]] std::vector<Offset> choose(const std::vector<EnvStatus>& status);
  void require_same(const RecordedSolve& solve, Law law) const;
  void append(const ContactBatch<double>& batch, const RecordedSolve& solve, const std::vector<Offset>& chosen,
              const Recording& dynamics);
  [[nodiscard]] RecordedSolve describe(const SolverOptions& options, Precision precision, RecordedForm form) const;
  void count_left_out(Offset before);

  std::filesystem::path path_;
  RecorderOptions options_;
  Recording recording_;
  std::int64_t takes_ = 0;
  Offset left_out_ = 0;
};

}  // namespace stiction::io
