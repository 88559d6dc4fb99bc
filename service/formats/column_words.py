"""Words in the names of columns, in lower case."""

from __future__ import annotations

SURVEY = (
    frozenset(
        (
            *("easting", "eastings", "east", "e", "utm_e", "utme", "e_utm", "x_utm", "utm_x"),
            *("rechtswert", "rechts", "rw", "ostwert", "ost", "este", "est", "x", "coord_x"),
            *("leste", "øst", "oest", "öst", "oost", "itä", "vychod", "východ", "wschód", "wschod"),
            *("восток", "схід", "изток", "istok", "kelet", "doğu", "sağa", "ida", "rytai"),
            *("đông", "timur", "东", "东坐标", "東", "東座標", "동", "شرق", "מזרח"),
        )
    ),
    frozenset(
        (
            *("northing", "northings", "north", "n", "utm_n", "utmn", "n_utm", "y_utm", "utm_y"),
            *("hochwert", "hoch", "hw", "nordwert", "nord", "norte", "y", "coord_y"),
            *("noord", "norr", "pohjoinen", "sever", "sjever", "północ", "polnoc", "север"),
            *("північ", "észak", "kuzey", "yukarı", "põhi", "šiaurė", "bắc", "utara"),
            *("北", "北坐标", "北座標", "북", "شمال", "צפון"),
        )
    ),
    frozenset(
        (
            *("elevation", "elev", "height", "altitude", "alt", "up", "h", "z", "level"),
            *("höhe", "hoehe", "cota", "cotă", "quota", "kote", "altura", "hauteur", "hohe"),
            *("hoogte", "høyde", "hoyde", "højde", "höjd", "korkeus", "výška", "vyska", "wysokość"),
            *("wysokosc", "visina", "magasság", "yükseklik", "kot", "kõrgus", "aukštis"),
            *("высота", "отметка", "висота", "височина", "кота", "cao độ", "tinggi", "elevasi"),
            *("高程", "標高", "高さ", "표고", "높이", "altitud", "altitudine"),
            *("elevación", "elevação", "élévation", "elevazione", "高", "ارتفاع", "גובה"),
            *("rl", "aod", "nap", "ngf", "ahd"),
        )
    ),
)
"""Names of surveyors for east, north and height, in some languages."""
SYSTEMS = frozenset(
    (
        *("mga", "mga94", "mga2020", "rd", "l93", "lambert", "lambert93", "gk", "mgi", "lv95"),
        *(
            "lv03",
            "osgb",
            "osgb36",
            "bng",
            "itm",
            "eov",
            "sjtsk",
            "jtsk",
            "sweref99",
            "utm",
            "tm35",
        ),
        *("utm31", "utm32", "utm33", "utm34", "utm35", "etrs89", "etrf", "itrf", "grid", "tm35"),
    )
)
"""Names of coordinate systems beside the letters of their axes: E_MGA, X_L93."""
PLACE_WORDS = SYSTEMS | frozenset(
    (
        *("", "coord", "coords", "coordinate", "coordinates", "koordinate", "pos", "position"),
        *("coördinaat", "coordinaat", "coordenada", "coordonnée", "coordonnee", "coordinata"),
        *("koord", "koordinat", "koordinata", "koordinatı", "координата", "坐标", "座標", "좌표"),
        *("wert", "point", "points", "pt", "pts", "p", "loc", "location", "world", "local"),
        *("global", "scan", "xyz", "geometry", "vertex", "map", "utm"),
        *("cartesian", "ecef", "lidar"),
        *("cloud", "pointcloud", "field", "data", "value", "val", "center", "centre", "centroid"),
        *("measured", "meas", "actual", "abs", "absolute"),
    )
)
"""Words around the letter of an axis in the names of coordinates: x_coord, point.x, Coord. X."""
QUALIFIERS = PLACE_WORDS | frozenset(
    (
        *("ortho", "orthometric", "ellipsoid", "ellipsoidal", "ellip", "grid", "ground", "gnss"),
        *("ngf", "nn", "nhn", "nap", "dhhn", "msl", "amsl", "navd", "navd88", "rh2000", "n2000"),
        *("ahd", "aod", "ü", "über", "evrf", "kronstadt"),
    )
)
"""Words beside the names of surveyors: Ortho. Height, Grid Easting."""
POLAR = {
    *("range", "azimuth", "theta", "phi", "rho", "bearing", "inclination", "zenith", "distance"),
    *("angle", "quality"),
}
LATITUDES = {"lat", "latitude", "glat", "breite"}
LONGITUDES = {"lon", "long", "lng", "longitude", "glon", "laenge", "länge"}
COMMON = {
    *("id", "index", "point", "nr", "name", "time", "timestamp", "t", "gpstime", "gps_time"),
    *("intensity", "i", "reflectance", "reflectivity", "amplitude", "range", "distance"),
    *("azimuth", "elevation", "r", "g", "b", "a", "red", "green", "blue", "alpha", "rgb"),
    *("class", "classification", "label", "ring", "laser_id", "channel", "return", "error"),
    *("alt", "altitude", "height", "z", "shotnumber", "velocity", "snr", "doppler", "weight"),
}
"""Names of columns that are no coordinates of their own."""
POINT_NAMES = (
    *("points", "xyz", "pcd", "positions", "vertices", "coords", "coord", "coordinates", "pc"),
    *("pos", "position", "point", "point_cloud", "pointcloud", "cloud", "location"),
    *("data", "arr_0"),
)
"""Names of arrays of points, in order of preference."""
NORMAL_NAMES = ("normal", "normals", "nxyz")
"""Names of fields of the three components of a normal."""
