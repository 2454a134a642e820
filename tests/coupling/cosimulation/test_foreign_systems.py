"""Systems that other tools publish, with units rebuilt as small equations, against own loops.

Rebuilt from the public descriptions of
- OMSimulator, testsuite/tests/resources/dcmotor (SSP 2.0, written by easySSP),
- OMSimulator, testsuite/tests/resources/LinearTransformation3 (SSP 2.0, written by OMSimulator),
- ecos, data/ssp/1.0/quarter_truck (SSP 1.0, with the step size of the Open Simulation Platform),
- libcosim, tests/data/ssp/linear_transformation (SSP 1.0).
Names, connections, parameters, units of measurement and peculiarities are theirs; the models inside
their units are not published with them and stand in units/foreign_units.py.
"""

import math
import shutil
import sys
import zipfile
from pathlib import Path

import pytest
from pythonfmu import FmuBuilder as Builder2
from pythonfmu3 import FmuBuilder as Builder3
from test_ssp import SPACES, connection

from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.ssp.reading import read_ssp
from lcmchain.errors import InputError

HERE = Path(__file__).parent / "units"
UNITS = {
    "edrive_mass": (3, "DriveMass"), "emachine_model": (3, "Machine"),
    "stimuli_model": (3, "Stimuli"), "chassis": (2, "Chassis"), "wheel": (2, "Wheel"),
    "ground": (2, "Ground"), "Gain": (3, "Gain"), "Add": (2, "Add"), "identity": (2, "Identity"),
}  # fmt: skip
SCRIPT = """
import ctypes
import {tool} as package
from foreign_units import {equations} as Equations, Slave{version}
from {tool} import Fmi{version}Slave

# at every instantiation pythonfmu 0.7 gives back a reference to these names that it never took
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))


class {name}(Slave{version}, Fmi{version}Slave):
    fmi, equations = package, Equations
"""


@pytest.fixture(scope="module")
def foreign(tmp_path_factory):
    """A folder with the archives of all units."""
    folder, path = tmp_path_factory.mktemp("foreign"), list(sys.path)
    shutil.copy(HERE / "foreign_units.py", folder)
    for name, (version, equations) in UNITS.items():
        tool, builder = {2: ("pythonfmu", Builder2), 3: ("pythonfmu3", Builder3)}[version]
        script = folder / f"unit_{name}.py"
        script.write_text(SCRIPT.format(name=name, tool=tool, version=version, equations=equations))
        builder.build_FMU(script, dest=folder, project_files=[folder / "foreign_units.py"],
                          needsExecutionTool="false")  # fmt: skip
        sys.modules.pop(script.stem, None)
    sys.path[:] = path
    sys.modules.pop("foreign_units", None)
    return folder


def read(foreign, tmp_path, structure, units, overrides=(), **files):
    """Return the system of an archive with a structure, units and further files."""
    tmp_path.mkdir(exist_ok=True)
    path = tmp_path / "foreign.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", structure)
        for unit in units:
            archive.write(foreign / f"{unit}.fmu", f"resources/{unit}.fmu")
        for name, text in files.items():
            archive.writestr(name.replace("__", "/").replace("_dot_", "."), text)
    return read_ssp(path, tmp_path / "in", list(overrides))


def connectors(**kinds):
    """Return connectors: the kind of each, and its unit after a blank."""
    rows = ""
    for name, about in kinds.items():
        kind, _, unit = about.partition(" ")
        inner = f'<ssc:Real unit="{unit}"/>' if unit else "<ssc:Real/>"
        rows += f'<ssd:Connector name="{name}" kind="{kind}">{inner}</ssd:Connector>'
    return f"<ssd:Connectors>{rows}</ssd:Connectors>"


def component(name, unit, inner, **attributes):
    about = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return (
        f'<ssd:Component name="{name}" source="resources/{unit}.fmu"{about}>{inner}</ssd:Component>'
    )


def bindings(*inner):
    return f"<ssd:ParameterBindings>{''.join(inner)}</ssd:ParameterBindings>"


def parameter_set(values, units="", version="2.0", spaces=""):
    """Return a parameter set: texts of a value and its unit after a blank."""
    rows = ""
    for name, text in values.items():
        value, _, unit = text.partition(" ")
        about = f' unit="{unit}"' if unit else ""
        rows += f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"{about}/></ssv:Parameter>'
    return (
        f'<ssv:ParameterSet{spaces} version="{version}" name="parameters">'
        f"<ssv:Parameters>{rows}</ssv:Parameters>{units}</ssv:ParameterSet>"
    )


def structure(name, version, system, more=""):
    return (
        f'<ssd:SystemStructureDescription {SPACES} version="{version}" name="{name}">'
        f"{system}{more}</ssd:SystemStructureDescription>"
    )


def unit_of(name, **base):
    """Return a definition as easySSP writes it: with every base unit, and as real numbers."""
    every = {key: base.get(key, 0) for key in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
    about = " ".join(f'{key}="{value}"' for key, value in every.items())
    return f'<ssc:Unit name="{name}"><ssc:BaseUnit {about} factor="1.0" offset="0.0"/></ssc:Unit>'


# --- OMSimulator: a motor with its load -----------------------------------------------------------

MOTOR = {
    "resistor.T_ref": "300.15 K", "resistor.T": "300.15 K", "resistor.alpha": "0.0 1/K",
    "inductor.L": "0.001 H", "emf.k": "0.1 N.m/A", "resistor.R": "0.5 Ohm",
}  # fmt: skip
MOTOR_UNITS = (
    unit_of("N.m/A", kg=1, m=2, s=-2, A=-1) + unit_of("K", K=1)
    + unit_of("Ohm", kg=1, m=2, s=-3, A=-2) + unit_of("H", kg=1, m=2, s=-2, A=-2)
    + unit_of("1/K", K=-1)
)  # fmt: skip
MASS = {"inertia.J": "0.002 kg.m2", "damper.d": "0.001 N.m.s/rad"}
MASS_UNITS = unit_of("N.m.s/rad", kg=1, m=2, s=-1, rad=-1) + unit_of("kg.m2", kg=1, m=2)
STIMULI = {
    "Voltage_step.offset": "0.0", "Voltage_step.startTime": "0.0 s",
    "Voltage_step.height": "12.0 V", "MLoad.k": "-0.5 N.m",
}  # fmt: skip
STIMULI_UNITS = (
    unit_of("V", kg=1, m=2, s=-3, A=-1) + unit_of("N.m", kg=1, m=2, s=-2) + unit_of("s", s=1)
)


def inline(values, units=""):
    units = f"<ssv:Units>{units}</ssv:Units>" if units else ""
    return (
        '<ssd:ParameterBinding prefix=""><ssd:ParameterValues>' + parameter_set(values, units)
        + "</ssd:ParameterValues></ssd:ParameterBinding>"
    )  # fmt: skip


def motor():
    """The nested system; ``stimuli_model.M_load`` is led to from outside though it is an output."""
    about = {"type": "application/x-fmu-sharedlibrary", "implementation": "ModelExchange"}
    inner = (
        '<ssd:System name="SuT">'
        + connectors(wB="output rad/s", M_load="input Nm", phiB="output rad", U="input V",
                     M_mot="output Nm", I="output A")
        + bindings(inline({})) + "<ssd:Elements>"
        + component("edrive_mass", "edrive_mass", connectors(
            M_A="input N.m", phiB="output rad", wB="output rad/s", wA="output rad/s",
            M_B="input N.m", phiA="output rad") + bindings(inline(MASS, MASS_UNITS)), **about)
        + component("emachine_model", "emachine_model", connectors(
            M="output N.m", U="input V", w="input rad/s", phi="input rad", I="output A")
            + bindings(inline(MOTOR, MOTOR_UNITS)), **about)
        + "</ssd:Elements><ssd:Connections>"
        + connection("edrive_mass/wB", "wB") + connection("M_load", "edrive_mass/M_B")
        + connection("edrive_mass/phiB", "phiB") + connection("U", "emachine_model/U")
        + connection("emachine_model/M", "M_mot") + connection("emachine_model/I", "I")
        + connection("emachine_model/M", "edrive_mass/M_A")
        + connection("edrive_mass/wA", "emachine_model/w")
        + connection("edrive_mass/phiA", "emachine_model/phi")
        + "</ssd:Connections></ssd:System>"
    )  # fmt: skip
    system = (
        '<ssd:System name="DC-Motor">'
        + connectors(M_mot="output Nm", wB="output", U="output", I="output", M_load="output Nm")
        + bindings(inline({})) + "<ssd:Elements>" + inner
        + component("stimuli_model", "stimuli_model", connectors(U="output V", M_load="output N.m")
                    + bindings(inline(STIMULI, STIMULI_UNITS)), **about)
        + "</ssd:Elements><ssd:Connections>"
        + connection("SuT/M_mot", "M_mot") + connection("SuT/wB", "wB")
        + connection("stimuli_model/U", "U") + connection("SuT/I", "I")
        + connection("stimuli_model/M_load", "SuT/M_load") + connection("stimuli_model/U", "SuT/U")
        + connection("M_load", "stimuli_model/M_load") + "</ssd:Connections></ssd:System>"
    )  # fmt: skip
    units = (
        unit_of("Nm", kg=1, m=2, s=-2) + unit_of("rad/s", s=-1, rad=1) + unit_of("rad", rad=1)
        + unit_of("V", kg=1, m=2, s=-3, A=-1) + unit_of("N.m", kg=1, m=2, s=-2) + unit_of("A", A=1)
    )  # fmt: skip
    return structure("DC-Motor", "2.0", system, f"<ssd:Units>{units}</ssd:Units>")


def test_the_motor_of_omsimulator_runs_as_an_own_loop(foreign, tmp_path):
    """Serial: the mass sees the torque of the window before, the armature the new speed."""
    system = read(foreign, tmp_path, motor(), ("edrive_mass", "emachine_model", "stimuli_model"),
                  ["window=1 ms", "scheme.type=gauss-seidel", "recorder.every=100"])  # fmt: skip
    assert [unit.name for unit in system.units] == [
        "SuT_edrive_mass", "SuT_emachine_model", "stimuli_model",
    ]  # fmt: skip
    assert system.stop_time == 1.0
    assert any("does not say when it ends" in text for text in system.remarks)
    assert sum("meant as ModelExchange" in text for text in system.remarks) == 3
    found = run_system(system, tmp_path / "out")["final_values"]

    inertia, damping, resistance, inductance, k, h = 0.002, 0.001, 0.5, 0.001, 0.1, 1e-3
    speed = angle = current = 0.0
    for _ in range(1000):
        lag, rest = inertia / damping, (k * current - 0.5) / damping
        above, decay = speed - rest, math.exp(-h * damping / inertia)
        angle += rest * h + above * lag * (1.0 - decay)
        speed = rest + above * decay
        rest = (12.0 - k * speed) / resistance
        current = rest + (current - rest) * math.exp(-h * resistance / inductance)
    expected = {
        "edrive_mass.wB": speed, "edrive_mass.phiB": angle, "emachine_model.I": current,
        "emachine_model.M": k * current,
    }  # fmt: skip
    for name, value in expected.items():
        assert found[f"SuT_{name}"] == pytest.approx(value, rel=1e-12), name
    # after ten time constants J R / k²: U = R I + k w, k I = 0.5 + d w
    steady = (k * 12.0 / resistance - 0.5) / (k * k / resistance + damping)
    assert speed == pytest.approx(steady, rel=1e-3) and current > 0.0


# --- OMSimulator: parameters that a mapping transforms --------------------------------------------

MAPPING = f"""<ssm:ParameterMapping {SPACES} version="2.0">
<ssm:MappingEntry source="mapped_Gain_u" target="Gain1.u">
<ssc:LinearTransformation factor="2" offset="10"/></ssm:MappingEntry>
<ssm:MappingEntry source="mapped_Gain_k" target="Gain1.k">
<ssc:LinearTransformation factor="4" offset="5"/></ssm:MappingEntry></ssm:ParameterMapping>"""


def test_mapped_parameters_reach_the_units_as_in_omsimulator(foreign, tmp_path):
    """OMSimulator's own test expects k = 13, u = 14 and y = 182."""
    system = (
        '<ssd:System name="default">'
        + bindings('<ssd:ParameterBinding source="resources/values.ssv">'
                   '<ssd:ParameterMapping source="resources/entries.ssm"/></ssd:ParameterBinding>')
        + "<ssd:Elements>"
        + component("Add1", "Add", connectors(u1="input", u2="input", y="output", k1="parameter",
                                              k2="parameter"))
        + component("Gain1", "Gain", connectors(u="input", y="output", k="parameter 1"))
        + "</ssd:Elements><ssd:Connections>" + connection("Gain1/y", "Add1/u1")
        + "</ssd:Connections></ssd:System>"
    )  # fmt: skip
    more = (
        '<ssd:Units><ssc:Unit name="1"><ssc:BaseUnit/></ssc:Unit></ssd:Units>'
        '<ssd:DefaultExperiment startTime="0.0" stopTime="1.0"/>'
    )
    values = parameter_set({"mapped_Gain_u": "2.0", "mapped_Gain_k": "2.0"}, spaces=f" {SPACES}")
    system = read(foreign, tmp_path, structure("default", "2.0", system, more), ("Add", "Gain"),
                  ["window=100 ms"], resources__values_dot_ssv=values,
                  resources__entries_dot_ssm=MAPPING)  # fmt: skip
    found = run_system(system, tmp_path / "out")["final_values"]
    assert {unit.name: unit.start for unit in system.units} == {
        "Add1": {}, "Gain1": {"u": {"value": 14.0}, "k": {"value": 13.0}},
    }  # fmt: skip
    assert found["Gain1.y"] == found["Add1.y"] == 182.0


# --- ecos: a quarter of a truck on a bump ---------------------------------------------------------

CHASSIS = {"C.mChassis": "400", "C.kChassis": "15000", "R.dChassis": "1000"}
WHEEL = {"C.mWheel": "40", "C.kWheel": "150000", "R.dWheel": "0"}


def truck():
    """Ports of bond graphs, parameters in files, and no end of the experiment."""

    def bound(unit):
        return bindings(f'<ssd:ParameterBinding source="ssv/initialValues_{unit}.ssv"/>')

    effort, flow = {"p.e": "output", "p.f": "input"}, {"p.e": "input", "p.f": "output"}
    wheel = {"p.f": "input", "p1.e": "input", "p.e": "output", "p1.f": "output"}
    system = (
        '<ssd:System name="QuarterTruckSystem"><ssd:Elements>'
        + component("chassis", "chassis", connectors(**effort) + bound("chassis"))
        + component("wheel", "wheel", connectors(**wheel) + bound("wheel"))
        + component("ground", "ground", connectors(**flow))
        + "</ssd:Elements><ssd:Connections>"
        + connection("chassis/p.e", "wheel/p1.e") + connection("wheel/p1.f", "chassis/p.f")
        + connection("wheel/p.e", "ground/p.e") + connection("ground/p.f", "wheel/p.f")
        + "</ssd:Connections></ssd:System>"
    )  # fmt: skip
    more = (
        '<ssd:DefaultExperiment startTime="10"><ssd:Annotations>'
        '<ssc:Annotation type="com.opensimulationplatform">'
        '<osp:Algorithm xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations">'
        '<osp:FixedStepAlgorithm baseStepSize="1e-4"/></osp:Algorithm>'
        "</ssc:Annotation></ssd:Annotations></ssd:DefaultExperiment>"
    )
    return structure("QuarterTruck", "1.0", system, more)


def test_the_truck_of_ecos_runs_as_an_own_loop(foreign, tmp_path):
    """Parallel, from 10 s on: all see what there was at the begin of a step.

    The step of the archive is 0.1 ms; the run takes 2^-13 s, so that all times are exact.
    """
    sets = {
        f"ssv__initialValues_{unit}_dot_ssv": parameter_set(values, "", "1.0", f" {SPACES}")
        for unit, values in (("chassis", CHASSIS), ("wheel", WHEEL))
    }
    units = ("chassis", "wheel", "ground")
    system = read(foreign, tmp_path, truck(), units, **sets)
    assert (system.start_time, system.window.size) == (10.0, 1e-4)
    assert system.scheme.type == "jacobi"
    h = 0.5**13
    exact = [f"window={h!r} s", "stop_time=10.125 s", "recorder.every=100"]
    system = read(foreign, tmp_path / "exact", truck(), units, exact, **sets)
    found = run_system(system, tmp_path / "out")["final_values"]

    spring = tyre = 0.0  # compressions
    body = wheel = 0.0  # velocities
    force = load = road = 0.0  # what all see at the begin of a step
    time = 10.0
    for _ in range(1024):
        seen = force, load, road, wheel
        spring += h * (seen[3] - body)
        force = 15000.0 * spring + 1000.0 * (seen[3] - body)
        body += h * force / 400.0
        force = 15000.0 * spring + 1000.0 * (seen[3] - body)  # as it is read after the step
        tyre += h * (seen[2] - wheel)
        load = 150000.0 * tyre
        wheel += h * (load - seen[0]) / 40.0
        time += h
        phase = (time - 10.05) / 0.1
        road = 0.05 * math.pi / 0.1 * math.sin(math.pi * phase) * (0.0 <= phase <= 1.0)
    expected = {
        "chassis.p.e": force, "wheel.p1.f": wheel, "wheel.p.e": load, "ground.p.f": road,
    }  # fmt: skip
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-12), name
    assert abs(body) > 0.01 and load > 1000.0


def test_an_experiment_without_an_end_takes_a_second(foreign, tmp_path):
    """Also one that begins at 10 s; a file that leaves the namespace of its prefix out is told."""
    sets = {f"ssv__initialValues_{unit}_dot_ssv": parameter_set({}, "", "1.0", f" {SPACES}")
            for unit in ("chassis", "wheel")}  # fmt: skip
    units = ("chassis", "wheel", "ground")
    system = read(foreign, tmp_path, truck(), units, **sets)
    assert system.stop_time == 11.0
    (told,) = [text for text in system.remarks if "does not say when it ends" in text]
    assert "11.0 s" in told and "stop_time" in told
    system = read(foreign, tmp_path / "set", truck(), units, ["stop_time=12 s"], **sets)
    assert not any("when it ends" in text for text in system.remarks)
    sets["ssv__initialValues_wheel_dot_ssv"] = parameter_set(WHEEL, "", "1.0")
    with pytest.raises(InputError, match=r'initialValues_wheel\.ssv.*prefix "?ssv'):
        read(foreign, tmp_path / "bare", truck(), units, **sets)


# --- libcosim: a value that is transformed on its way ---------------------------------------------


def test_the_transformation_of_libcosim_is_its_own(foreign, tmp_path):
    """libcosim's own test expects 1.3 times the value of ``realOut`` plus 50."""
    system = (
        '<ssd:System name="test-linear-transformation"><ssd:Elements>'
        + component("identity1", "identity", connectors(realIn="input", realOut="output")
                    + bindings('<ssd:ParameterBinding source="initial_values.ssv"/>'))
        + component("identity2", "identity", connectors(realIn="input"))
        + "</ssd:Elements><ssd:Connections>"
        + connection("identity1/realOut", "identity2/realIn",
                     '<ssc:LinearTransformation offset="50" factor="1.3"/>')
        + "</ssd:Connections></ssd:System>"
    )  # fmt: skip
    values = parameter_set({"realIn": "2"}, version="1.0", spaces=f" {SPACES}")
    system = read(foreign, tmp_path, structure("simple-cse-example", "1.0", system), ("identity",),
                  ["window=100 ms"], initial_values_dot_ssv=values)  # fmt: skip
    found = run_system(system, tmp_path / "out")["final_values"]
    assert found["identity1.realOut"] == 2.0
    assert found["identity2.realOut"] == pytest.approx(52.6, rel=1e-12)
