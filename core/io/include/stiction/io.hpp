#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stiction/batch.hpp"
#include "stiction/jacobian.hpp"
#include "stiction/solver.hpp"
#include "stiction/status.hpp"
#include "stiction/world.hpp"

/// Problems and solutions in HDF5 files (docs/reference/file_formats.md). Every function may be called from any thread;
/// calls wait for one another. It fails with Error(io) when the operating system refuses, with Error(bad_file) when
/// the content is wrong. The message is one sentence that begins with the file's name.
namespace stiction::io {

/// A sparse matrix by rows. An empty ptr: the matrix is absent.
struct Csr {
  std::vector<Offset> ptr;  ///< row offsets                       (rows + 1)
  std::vector<Index> col;   ///< column within the environment     (nnz)
  std::vector<double> val;  ///< value                             (nnz)
};

/// Input of a recorded solve: matrices, J and M, or bodies.
enum class RecordedForm : std::uint8_t { matrix, jacobian, bodies };

/// Options of a recorded solve, to get the same bits again. The law is the batch's.
struct RecordedSolve {
  RecordedForm form = RecordedForm::matrix;
  SolverKind solver = SolverKind::npgs;
  Precision precision = Precision::f64;  ///< of the solve; f32 numbers are widened exactly in memory
  double tolerance = 0, absolute_tolerance = 0, omega = 1;
  IslandMode islands = IslandMode::together;
  BlockMode blocks = BlockMode::cones;
  Index max_iterations = 0, stall_window = 0;
  Index direct_rows = SolverOptions{}.direct_rows;
  SolverChoice choose = SolverChoice::named;
  SpectrumRules spectrum;          ///< read where choose is spectrum; keep is false
  int numerics_epoch = 0;          ///< bits are promised within one epoch
  std::vector<double> warm_start;  ///< empty: from zero                          (rows)
  std::vector<double> lambda;      ///< the answer                                (rows)
  Offset left_out = 0;             ///< environments that found no room in the file
};

/// A contact-batch file in memory. Optional parts are empty when absent.
struct Recording {
  ContactBatch<double> batch;
  std::string source;                   ///< origin of the recording, free text
  std::vector<Offset> env_dof_offsets;  ///< first degree of freedom of each environment  (E + 1)
  Csr J;                              ///< constraint Jacobian, A = J M^-1 J'           (rows x dofs of the environment)
  Csr M;                              ///< joint-space mass matrix                      (dofs x dofs)
  std::vector<double> v_free;         ///< unconstrained motion                         (dofs)
  std::vector<double> row_target;     ///< b = J v_free - row_target                    (rows)
  std::vector<double> lambda_ref;     ///< a reference solution                         (rows)
  std::vector<double> v_ref;          ///< its motion                                   (dofs)
  std::vector<std::string> env_name;  ///< a name for each environment                  (E)
  std::vector<std::int64_t> step;     ///< time step each environment was taken from    (E)
  std::vector<double> dt;             ///< length of that step [s]                      (E)
  std::vector<std::uint64_t> cone_id;  ///< the same number for the same contact in every step, unique within an
                                       ///< environment (WarmStartStore)                 (K)
  std::optional<RecordedSolve> solve;  ///< written by a Recorder (stiction/recorder.hpp)
};

enum class FileKind { contact_batch, fclib_local, fclib_global, fclib_rolling };

/// Returns the kind of a file, by content. \throws Error
FileKind detect(const std::filesystem::path& path);

/// Reads a contact batch or an FCLIB problem, by content. Shapes, offsets and types are checked; columns of A and
/// numerical values are not (that is stiction::validate). FCLIB global problems are condensed to W = H' M^-1 H and
/// keep J = H', M, v_free, row_target. \throws Error
Recording read_batch(const std::filesystem::path& path);

/// The Jacobian batch of a recording that has J and M. J has the stored entries. M is in blocks of 1, 3 or 6 where all
/// of it lies in such, else dense. With an `order`, environment k of the batch is the recording's number order[k].
/// \throws Error(invalid_argument) if the recording lacks J, M or v_free, or an array does not fit the batch. Also if
/// an M is not symmetric, or is dense and has more than 8192 degrees of freedom. Also if `order` names an environment
/// that is not there.
template <class Real>
JacobianBatch<Real> jacobian_batch(const Recording& recording, std::span<const Offset> order = {});

/// Keeps J, M, v_free and the target of a host batch in a recording, f32 widened exactly. M given as a factor is
/// multiplied out, which rounds. `environments` are those that the recording's batch has, by number; none: all of them.
/// \throws Error(invalid_argument) if the batch is in device memory or `environments` names one that is not there
template <class Real>
void keep_dynamics(Recording& recording, const JacobianBatchView<Real>& batch,
                   std::span<const Offset> environments = {});

/// Writes a contact batch: to a temporary file beside `path` that is renamed when complete.
/// \throws Error(invalid_argument) if an optional part's length does not fit the batch, Error(io)
void write_batch(const std::filesystem::path& path, const Recording& recording);

/// Writes environment `env` as an FCLIB local problem with W = A + diag R, q = b.
/// \throws Error(invalid_argument) if env is out of range or FCLIB cannot express it. The law must be coulomb and
/// every cone a friction cone of the same size, 2 or 3, with one mu for its tangential rows
void write_fclib_local(const std::filesystem::path& path, const Recording& recording, Offset env);

/// Which environments of a batch a solution file holds that does not hold all (`stiction solve --shard`).
struct SolutionShard {
  std::int64_t index = 0;        ///< the part's number, from 0
  std::int64_t count = 1;        ///< parts there are
  Offset first_environment = 0;  ///< number in the batch of the file's first environment
  Offset environment_count = 0;  ///< environments of the whole batch
  std::string input;             ///< hash of the file that was solved; parts of one solution have one
  std::string options;           ///< whatever reached the bits, "name=value" each; parts of one solution have one
};

/// A solution file in memory, in the order of the batch it belongs to. Everything but lambda may be empty.
struct SolutionFile {
  Precision precision = Precision::f64;  ///< type of lambda and w in the file; f32 is widened exactly
  std::vector<double> lambda;            ///< reactions                             (rows)
  std::vector<double> w;                 ///< residual motion                       (rows)
  std::vector<EnvStatus> status;         ///< one record each                       (E)
  std::vector<Offset> env_row_offsets;   ///< first row of each environment         (E + 1)
  Law law = Law::convex;                 ///< law that was solved
  std::string solver;                    ///< command-line name of the solver
  std::string source;                    ///< the batch, free text
  std::optional<SolutionShard> shard;    ///< without: all environments of the batch
};

/// \throws Error
SolutionFile read_solution(const std::filesystem::path& path);

/// Writes like write_batch. \throws Error(invalid_argument) if the lengths do not fit one another, Error(io)
void write_solution(const std::filesystem::path& path, const SolutionFile& solution);

/// A world between two steps on disk (docs/reference/file_formats.md): the file of `stiction step --checkpoint`.
struct CheckpointFile {
  Precision precision = Precision::f64;  ///< type of the numbers in the file; f32 is widened exactly
  std::string run;                       ///< whatever reaches the bits of the run, "name=value" each
  std::int64_t step = 0;                 ///< steps that were made, >= 0
  WorldCheckpoint<double> world;         ///< of any number of environments and bodies
};

/// Reads a checkpoint, and compares its contents with the checksum that it was written with. One in parts is read as
/// one. \throws Error
CheckpointFile read_checkpoint(const std::filesystem::path& path);

/// Whose run a checkpoint is of, and how far that had come.
struct CheckpointHead {
  std::string run;        ///< of CheckpointFile
  std::int64_t step = 0;  ///< of CheckpointFile
};

/// Reads the head of a checkpoint alone, whether it is one file or in parts. Its other contents are not looked at.
/// \throws Error
CheckpointHead read_checkpoint_head(const std::filesystem::path& path);

/// Bodies first .. end - 1 of every environment.
struct CheckpointBodies {
  Offset first = 0;  ///< the first of them
  Offset end = 0;    ///< one past the last
};

/// Some bodies of a checkpoint. Contacts are those of all bodies that lie in the same parts.
struct CheckpointShare {
  CheckpointFile file;      ///< `world` is of these bodies alone
  CheckpointBodies bodies;  ///< those that were asked for and are there
};

/// Reads some bodies of a checkpoint of `environments` environments. If it is in parts, only the parts that hold them
/// are read. \throws Error
CheckpointShare read_checkpoint(const std::filesystem::path& path, Offset environments, CheckpointBodies bodies);

/// Data that the parts of a checkpoint share (docs/reference/file_formats.md).
struct CheckpointParts {
  std::string run;                      ///< of CheckpointFile
  std::int64_t step = 0;                ///< of CheckpointFile
  std::vector<Offset> body_offsets;     ///< first body of each part's, closed by their number  (parts + 1)
  std::vector<std::int64_t> checksums;  ///< that write_checkpoint_part() returned              (parts)
};

/// Returns the path of part k of n of a checkpoint of that step: beside it.
std::filesystem::path checkpoint_part(const std::filesystem::path& path, std::int64_t step, std::int64_t k,
                                      std::int64_t n);
/// Writes a part: a checkpoint of some bodies, with the contacts that they take part in. A contact may be in two parts.
/// Returns its checksum when it is on the disk. \throws Error(io)
std::int64_t write_checkpoint_part(const std::filesystem::path& part, const CheckpointFile& checkpoint);
/// Makes parts that were written a checkpoint, and removes those of the one that was there. \throws Error(io)
void write_checkpoint_parts(const std::filesystem::path& path, const CheckpointParts& parts);

/// Writes like write_batch, and returns when the file is on the disk. \throws Error(io)
void write_checkpoint(const std::filesystem::path& path, const CheckpointFile& checkpoint);

}  // namespace stiction::io
