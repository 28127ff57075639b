#pragma once

/// \file
/// Includes every header but analysis.hpp and pyramid.hpp.

#include "stiction/batch.hpp"
#include "stiction/bodies.hpp"
#include "stiction/box_friction.hpp"
#include "stiction/config.hpp"
#include "stiction/contact_graph.hpp"
#include "stiction/derivative.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"
#include "stiction/jacobian.hpp"
#include "stiction/jacobian_bodies.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/padded.hpp"
#include "stiction/preset.hpp"
#include "stiction/pyramid.hpp"
#include "stiction/residual.hpp"
#include "stiction/solver.hpp"
#include "stiction/status.hpp"
#include "stiction/stepping.hpp"
#include "stiction/thread_meter.hpp"
#include "stiction/trace.hpp"
#include "stiction/types.hpp"
#include "stiction/warm_start.hpp"
#include "stiction/world.hpp"
#include "stiction/world_derivative.hpp"
