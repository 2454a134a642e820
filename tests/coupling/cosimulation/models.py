"""The units of the tests."""

from unit_builder import Model, Var

#: An oscillator of one mass: takes a force, gives its position. Exact for a force held constant.
MASS = Model(
    "Mass",
    [
        Var("force", "input", start=0.0, unit="N"),
        Var("mass", "parameter", start=1.0, unit="kg"),
        Var("stiffness", "parameter", start=1.0, unit="N/m"),
        Var("position0", "parameter", start=1.0, unit="m"),
        Var("position", unit="m"),
        Var("velocity", unit="m/s"),
        Var("x", "local", start=0.0),
        Var("v_", "local", start=0.0),
        Var("started", "local", start=0.0),
    ],
    answer="if (!started) { x = position0; started = 1; } position = x; velocity = v_;",
    advance="""answer(v); double w = sqrt(stiffness / mass), rest = force / stiffness;
        double a = x - rest, b = v_ / w, c = cos(w * h), s = sin(w * h);
        x = rest + a * c + b * s; v_ = w * (b * c - a * s); return 0;""",
)
#: The other mass with the spring between both: takes a position, gives the force on the first mass.
TAIL = Model(
    "Tail",
    [
        Var("position1", "input", start=0.0, unit="mm"),
        Var("mass", "parameter", start=1.0, unit="kg"),
        Var("coupling", "parameter", start=1.0, unit="N/m"),
        Var("stiffness", "parameter", start=1.0, unit="N/m"),
        Var("force", unit="kN", needs=("position1",)),
        Var("position", unit="m"),
        Var("x", "local", start=0.0),
        Var("v_", "local", start=0.0),
    ],
    answer="force = 1e-3 * coupling * (x - 1e-3 * position1); position = x;",
    advance="""double k = stiffness + coupling, w = sqrt(k / mass);
        double rest = coupling * 1e-3 * position1 / k;
        double a = x - rest, b = v_ / w, c = cos(w * h), s = sin(w * h);
        x = rest + a * c + b * s; v_ = w * (b * c - a * s); return 0;""",
)
#: y follows u after a step: y = gain u + shift.
FOLLOWER = Model(
    "Follower",
    [
        Var("x_in", "input", start=0.0),
        Var("gain", "parameter", start=1.0),
        Var("shift", "parameter", start=0.0),
        Var("y"),
    ],
    advance="y = gain * x_in + shift; return 0;",
)
#: y follows u at once.
GAIN = Model(
    "Gain",
    [
        Var("x_in", "input", start=0.0),
        Var("gain", "parameter", start=1.0),
        Var("shift", "parameter", start=0.0),
        Var("y", needs=("x_in",)),
    ],
    answer="y = gain * x_in + shift;",
)
#: A row of n values: y_i = a u_i + b u_(i-1) + c, after a step.
N = 40
FIELD = Model(
    "Field",
    [
        Var("x_in", "input", start=0.0, unit="Pa", size=N),
        Var("a", "parameter", start=0.5),
        Var("b", "parameter", start=0.25),
        Var("c", "parameter", start=1.0),
        Var("y", unit="Pa", size=N),
        Var("sum", unit="Pa"),
    ],
    advance=f"""sum = 0;
        for (int k = 0; k < {N}; k++) {{
            y[k] = a * x_in[k] + b * (k ? x_in[k - 1] : 0.0) + c * (k + 1);
            sum += y[k];
        }}
        return 0;""",
)
#: A linear system of any size, as the one among the Reference FMUs: y = C x + D u after steps of
#: x' = A x + B u by Euler's method, with sizes up to 5, of which its library has room for 4.
ROOM = 4
_SIZES = {name: Var(name, "structuralParameter", "size", 3, limits=(0, 5))
          for name in ("count_u", "count_x", "count_y")}  # fmt: skip


def _array(name, causality, *by, start=None):
    return Var(name, causality, start=start, size=ROOM ** len(by), by=by)


SPACE = Model(
    "Space",
    [
        *_SIZES.values(),
        _array("A", "parameter", "count_x", "count_x", start=1.0),
        _array("B", "parameter", "count_x", "count_u", start=1.0),
        _array("C", "parameter", "count_y", "count_x", start=1.0),
        _array("D", "parameter", "count_y", "count_u", start=1.0),
        _array("x0", "parameter", "count_x", start=0.0),
        _array("u_in", "input", "count_u", start=0.0),
        _array("y", "output", "count_y"),
        Var("gain", "parameter", start=1.0),
        _array("x", "local", "count_x", start=0.0),
        Var("started", "local", start=0.0),
    ],
    answer="""
        if (!started) { for (int i = 0; i < count_x; i++) (x)[i] = (x0)[i]; started = 1; }
        for (int i = 0; i < count_y; i++) {
            double sum = 0;
            for (int j = 0; j < count_x; j++) sum += (C)[i * count_x + j] * (x)[j];
            for (int j = 0; j < count_u; j++) sum += (D)[i * count_u + j] * (u_in)[j];
            (y)[i] = sum;
        }""",
    advance="""
        answer(v);
        double next[8];
        for (int i = 0; i < count_x; i++) {
            double sum = 0;
            for (int j = 0; j < count_x; j++) sum += (A)[i * count_x + j] * (x)[j];
            for (int j = 0; j < count_u; j++) sum += (B)[i * count_u + j] * (u_in)[j];
            next[i] = (x)[i] + h * sum;
        }
        for (int i = 0; i < count_x; i++) (x)[i] = next[i];
        return 0;""",
    extra=f"#define LARGEST {ROOM}",
)
#: Temperature in degC out, in K in.
KETTLE = Model(
    "Kettle",
    [Var("temperature", unit="degC"), Var("difference", unit="degC")],
    answer="temperature = 20.0;",
)
SENSOR = Model(
    "Sensor",
    [Var("temperature", "input", start=0.0, unit="K"), Var("seen", unit="K")],
    advance="seen = temperature; return 0;",
)
#: Switches, whole numbers and texts: counts its steps, gives them away and takes them.
COUNTER = Model(
    "Counter",
    [
        Var("on_in", "input", "truth", False),
        Var("count_in", "input", "whole", 0),
        Var("word_in", "input", "text", "none"),
        Var("first", "parameter", "whole", 0),
        Var("greeting", "parameter", "text", "step"),
        Var("on", kind="truth", variability="discrete"),
        Var("count", kind="whole", variability="discrete"),
        Var("word", kind="text", variability="discrete"),
        Var("seen_on", kind="truth", variability="discrete"),
        Var("seen_count", kind="whole", variability="discrete"),
        Var("seen_word", kind="text", variability="discrete"),
        Var("steps", "local", "whole", 0),
    ],
    answer='count = first + steps; on = steps % 2; snprintf(word, 64, "%s %d", greeting, steps);',
    advance="""seen_on = on_in; seen_count = count_in; strcpy(seen_word, word_in); steps++;
        return 0;""",
)
#: Falls and bounces; refuses steps above a size, fails or ends at a height.
BALL = Model(
    "Ball",
    [
        Var("push", "input", start=0.0),
        Var("largest_step", "parameter", start=1e9, unit="s"),
        Var("failing_time", "parameter", start=1e9, unit="s"),
        Var("ending_time", "parameter", start=1e9, unit="s"),
        Var("height", unit="m"),
        Var("bounces", kind="whole", variability="discrete"),
        Var("z", "local", start=1.0),
        Var("w", "local", start=0.0),
    ],
    answer="height = z;",
    advance="""
        if (h > largest_step) {
            v->reached = t + largest_step; say(u, 2, "the step is too long"); return 2;
        }
        if (t + h > failing_time) { say(u, 3, "the ball burst"); return 3; }
        for (double left = h; left > 0;) {
            double d = left;
            double hit = (w + sqrt(w * w + 2 * 9.81 * z)) / 9.81;
            int bounce = hit < left;
            if (bounce) d = hit;
            z += w * d - 0.5 * 9.81 * d * d; w -= 9.81 * d; left -= d;
            if (bounce) { z = 0; w = -0.7 * w; bounces++; if (w < 0.01) { w = 0; break; } }
        }
        if (t + h >= ending_time - 1e-12) {
            if (FMI == 2) { v->reached = t + h; }
            v->end = 1;
            return FMI == 2 ? 2 : 0;
        }
        return 0;""",
)  # fmt: skip
#: Cannot go back.
ONE_WAY = Model(
    "OneWay",
    FOLLOWER.variables,
    advance=FOLLOWER.advance,
    options={"canGetAndSetFMUstate": "false", "canHandleVariableCommunicationStepSize": "false"},
)
#: Ends its process, crashes or hangs in the step that goes beyond a time; or at once, when read.
TROUBLE = Model(
    "Trouble",
    [
        Var("push", "input", start=0.0),
        Var("how", "parameter", start=0.0),
        Var("when", "parameter", start=1e9, unit="s"),
        Var("y"),
    ],
    extra="""
        #include <unistd.h>
        #include <signal.h>
        static void fail(double kind) {
            printf("what a unit prints\\n");
            fflush(stdout);
            switch ((int)kind) {
            case 1: exit(3);
            case 2: exit(0);
            case 3: signal(SIGABRT, SIG_DFL); abort();
            case 4: signal(SIGSEGV, SIG_DFL); *(volatile int *)0 = 1;
            case 5: for (;;) pause();
            case 6: if (fork() == 0) for (;;) pause(); _exit(4);
            }
        }""",
    answer="if (how >= 10) fail(how - 10);",
    advance="if (t + h > when) fail(how); y = t + h + push; return 0;",
)
ALL = (MASS, TAIL, FOLLOWER, GAIN, FIELD, KETTLE, SENSOR, COUNTER, BALL, TROUBLE)
