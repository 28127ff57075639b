#pragma once

#include "core/io/hdf5_in.hpp"
#include "core/io/hdf5_out.hpp"
#include "stiction/io.hpp"

namespace stiction::io {

/// The group `solve` of a contact-batch file of that many rows; nothing if there is none.
std::optional<RecordedSolve> read_recorded_solve(const InputFile& file, std::size_t rows);

/// \throws Error(invalid_argument) if a length does not fit, before anything is written.
void check_recorded_solve(const RecordedSolve& solve, std::size_t rows);
void write_recorded_solve(OutputFile& file, const RecordedSolve& solve);

}  // namespace stiction::io
