#include "tests/ptx/lane.hpp"

#include "tests/ptx/grid.hpp"
#include "tests/ptx/trace.hpp"

namespace stiction::ptx {

namespace {

constexpr u32 kWarp = 32;

/// A lane waits for those of a mask.
void trace_meeting(const Lane& lane, TraceKind kind, u32 mask) {
  if (lane.trace != nullptr) lane.trace->events.push_back(trace_event(kind, mask));
}

}  // namespace

void Lane::trace_piece(u32 number) const {
  trace->events.push_back(trace_event(kTracePiece, number));
}
void Lane::trace_call(bool enters) const {
  trace->events.push_back(trace_event(enters ? kTraceCall : kTraceReturn, 0));
}
u64 Lane::trace_access(u16 number, u64 address) const {
  trace->events.push_back(trace_event(number, address));
  return address;
}

u32 Lane::grid_word(int half) const {
  return static_cast<u32>(grid->barrier_address() >> 32 * half);
}

void Lane::meet_block() {
  trace_meeting(*this, kTraceBarrier, ~u32{0});
  grid->wait({Waiting::block, 0, 0, 0});
}
void Lane::meet_warp(u32 mask) {
  trace_meeting(*this, kTraceBarrier, mask);
  grid->wait({Waiting::warp, mask, 0, 0});
}

u32 Lane::shuffle_bfly(u32 value, u32 distance, u32 bounds, u32 mask) {
  trace_meeting(*this, kTraceExchange, mask);
  const u32 own = thread % kWarp, segment = bounds >> 8 & 31U;
  const u32 last = (own & segment) | (bounds & 31U & ~segment), from = own ^ (distance & 31U);
  return grid->wait({Waiting::shuffle, mask, value, from > last ? own : from});
}
u32 Lane::shuffle_idx(u32 value, u32 source, u32 bounds, u32 mask) {
  trace_meeting(*this, kTraceExchange, mask);
  const u32 own = thread % kWarp, segment = bounds >> 8 & 31U;
  const u32 last = (own & segment) | (bounds & 31U & ~segment), from = (own & segment) | (source & 31U & ~segment);
  return grid->wait({Waiting::shuffle, mask, value, from > last ? own : from});
}
u32 Lane::reduce_or(u32 value, u32 mask) {
  trace_meeting(*this, kTraceExchange, mask);
  return grid->wait({Waiting::any, mask, value, 0});
}
u32 Lane::reduce_add(u32 value, u32 mask) {
  trace_meeting(*this, kTraceExchange, mask);
  return grid->wait({Waiting::sum, mask, value, 0});
}

void Lane::spin() {
  grid->wait({Waiting::turn, 0, 0, 0});
}
void Lane::leave() {
  grid->wait({Waiting::end, 0, 0, 0});
  __builtin_unreachable();
}
void Lane::trap() {
  grid->fail(*this, "executed a trap");
}

std::vector<Kernel*>& kernels() {
  static auto& all = *new std::vector<Kernel*>;  // also while the process ends
  return all;
}

std::vector<TracedKernel>& traced_kernels() {
  static auto& all = *new std::vector<TracedKernel>;
  return all;
}

void launch(Kernel& kernel, const cuda::EmulatedLaunch& shape, const void* arguments) {
  ++kernel.launches;
  Grid(kernel, shape.shape).run(arguments);
}

}  // namespace stiction::ptx
