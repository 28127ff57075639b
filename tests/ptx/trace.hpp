#pragma once

#include <cstdint>
#include <string>
#include <vector>

/// Events that lanes leave behind which execute code translated with traces (tools/ptx_trace.py).
namespace stiction::ptx {

/// A straight piece of code. Lanes that execute it together issue its instructions once.
struct TracedPiece {
  std::uint32_t instructions;
  std::uint32_t function;
  std::uint32_t position;  ///< in its function, in an order in which all of a loop comes before its successors
  std::uint32_t access;    ///< its first
};

/// Facts of one translated file. Numbers of pieces begin at 1.
struct TracedCode {
  const char* const* functions;  ///< mangled names
  const TracedPiece* pieces;
  const std::uint32_t* access_bytes;  ///< of each place that loads from memory or stores to it
};

/// Events of a lane in the order of execution: a kind in the upper 16 bits, its subject in the others. A piece follows
/// its events. A kind below these is an access of the piece by its number, with the address.
enum TraceKind : std::uint16_t {
  kTracePiece = 0xFFF0,  ///< its number
  kTraceCall,            ///< a function is entered
  kTraceReturn,          ///< and left
  kTraceBarrier,         ///< mask of lanes that wait for one another
  kTraceExchange,        ///< the same, at an instruction that passes values between lanes
};
constexpr std::uint64_t trace_event(std::uint16_t kind, std::uint64_t of) {
  return std::uint64_t{kind} << 48U | of;
}

struct LaneTrace {
  std::vector<std::uint64_t> events;
  std::uint64_t stack = 0;   ///< address at which its stack begins, downwards
  std::uint64_t shared = 0;  ///< address of its block's shared memory
};

/// One launch of a kernel.
struct TracedLaunch {
  const TracedCode* code = nullptr;
  std::string kernel;  ///< mangled
  std::vector<unsigned char> arguments;
  std::uint64_t parameters[2][2] = {};  ///< addresses at which each parameter begins and ends
  std::uint64_t shared_bytes = 0;       ///< of a block
  std::vector<LaneTrace> lanes;         ///< of all blocks
};

}  // namespace stiction::ptx
