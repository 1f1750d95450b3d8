"""The processor's peak rate of fused multiply-adds on one core, measured by a compiled loop."""

import ctypes
import time

from llvmlite import binding

CHAINS = 16  # independent sums: more than latency (4 cycles) times units (2) of any processor here
LOOPS = 1 << 16
SECONDS = 0.2  # CPU time of each measurement


def vector_bytes() -> int:
    """Return the width of the widest vector registers, in bytes."""
    features = binding.get_host_cpu_features()
    return 64 if features.get("avx512f") else 32 if features.get("fma") else 16


def _source(lanes: int, kind: str) -> str:
    """LLVM code of a loop of CHAINS fused multiply-adds of whole vectors per iteration."""
    vector = f"<{lanes} x {kind}>"
    name = f"@llvm.fma.v{lanes}{'f64' if kind == 'double' else 'f32'}"

    def each(line, join="\n"):
        return join.join(line.format(c=c) for c in range(CHAINS))

    sums = "\n".join(
        f"%t{c} = fadd {vector} {f'%t{c - 1}' if c else 'zeroinitializer'}, %b{c}"
        for c in range(CHAINS)
    )
    return f"""
declare {vector} {name}({vector}, {vector}, {vector})
define void @peak(ptr %out, i64 %loops) {{
entry:
  %start = load {vector}, ptr %out, align 4
  br label %loop
loop:
  %i = phi i64 [0, %entry], [%next, %loop]
{each(f"  %a{{c}} = phi {vector} [%start, %entry], [%b{{c}}, %loop]")}
{each(f"  %b{{c}} = call {vector} {name}({vector} %a{{c}}, {vector} %start, {vector} %a{{c}})")}
  %next = add i64 %i, 1
  %more = icmp ult i64 %next, %loops
  br i1 %more, label %loop, label %done
done:
{sums}
  store {vector} %t{CHAINS - 1}, ptr %out, align 4
  ret void
}}
"""


def peak(precision: str) -> float:
    """Return fused multiply-adds per CPU second (per lane, so 8 or 16 for a 512-bit vector)."""
    kind, size = ("double", 8) if precision == "double" else ("float", 4)
    lanes = vector_bytes() // size
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=2
    )
    module = binding.parse_assembly(_source(lanes, kind))
    with binding.create_mcjit_compiler(module, machine) as engine:
        engine.finalize_object()
        run = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)(
            engine.get_function_address("peak")
        )
        values = ((ctypes.c_double if kind == "double" else ctypes.c_float) * lanes)(*[0.0] * lanes)
        best = 0.0
        for _ in range(5):  # the best of five: other work on the machine only slows the loop
            begin = now = time.thread_time()
            calls = 0
            while now - begin < SECONDS:
                run(ctypes.addressof(values), LOOPS)
                calls += 1
                now = time.thread_time()
            best = max(best, calls * LOOPS * CHAINS * lanes / (now - begin))
    return best
