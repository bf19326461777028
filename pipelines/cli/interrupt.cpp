#include "pipelines/cli/interrupt.h"

#include <csignal>

namespace hsi4d::cli {

namespace {

volatile std::sig_atomic_t interrupt_requested = 0;

extern "C" void note_interrupt(int signal) {
  interrupt_requested = 1;
  std::signal(signal, SIG_DFL);  // the next one is not asked twice
}

}  // namespace

InterruptWatch::InterruptWatch() {
  interrupt_requested = 0;
  std::signal(SIGINT, note_interrupt);
  std::signal(SIGTERM, note_interrupt);
}

InterruptWatch::~InterruptWatch() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

bool InterruptWatch::requested() { return interrupt_requested != 0; }

}  // namespace hsi4d::cli
