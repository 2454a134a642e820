"""Names of SSP 1.0 and 2.0, which share their XML namespaces."""

COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"
DESCRIPTION = "http://ssp-standard.org/SSP1/SystemStructureDescription"
VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
MAPPING = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
SSC, SSD, SSV, SSM = (f"{{{name}}}" for name in (COMMON, DESCRIPTION, VALUES, MAPPING))

STRUCTURE_FILE = "SystemStructure.ssd"
FMU_TYPE = "application/x-fmu-sharedlibrary"
