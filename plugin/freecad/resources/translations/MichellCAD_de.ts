<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="de" sourcelanguage="en">
  <context>
    <name>MichellCAD</name>
    <message>
      <source>Michell trusses</source>
      <translation>Michell-Fachwerke</translation>
    </message>
    <message>
      <source>Stress-aligned trusses of any body, with live knobs</source>
      <translation>Fachwerke entlang der Spannungen beliebiger Körper, mit Reglern, die sofort wirken</translation>
    </message>
    <message>
      <source>Michell truss</source>
      <translation>Michell-Fachwerk</translation>
    </message>
    <message>
      <source>Export truss</source>
      <translation>Fachwerk exportieren</translation>
    </message>
    <message>
      <source>Save job file</source>
      <translation>Auftragsdatei speichern</translation>
    </message>
    <message>
      <source>New truss...</source>
      <translation>Neues Fachwerk...</translation>
    </message>
    <message>
      <source>Pick supports and loads on a body and compute its stress-aligned truss</source>
      <translation>Lager und Lasten an einem Körper wählen und sein Fachwerk entlang der Spannungen berechnen</translation>
    </message>
    <message>
      <source>Supports and loads...</source>
      <translation>Lager und Lasten...</translation>
    </message>
    <message>
      <source>Change what the selected truss was computed from, and compute it again</source>
      <translation>Ändern, woraus das gewählte Fachwerk berechnet wurde, und es neu berechnen</translation>
    </message>
    <message>
      <source>Export truss...</source>
      <translation>Fachwerk exportieren...</translation>
    </message>
    <message>
      <source>Write the selected truss as STEP (named, coloured faces) or STL (watertight)</source>
      <translation>Das gewählte Fachwerk als STEP (benannte, farbige Flächen) oder STL (wasserdicht) schreiben</translation>
    </message>
    <message>
      <source>Save job file...</source>
      <translation>Auftragsdatei speichern...</translation>
    </message>
    <message>
      <source>Write the job of the selected truss for the command line: michell-cad design</source>
      <translation>Den Auftrag des gewählten Fachwerks für die Kommandozeile schreiben: michell-cad design</translation>
    </message>
    <message>
      <source>support {n}</source>
      <translation>Lager {n}</translation>
    </message>
    <message>
      <source>load {n}</source>
      <translation>Last {n}</translation>
    </message>
    <message>
      <source>a support</source>
      <translation>ein Lager</translation>
    </message>
    <message>
      <source>a load</source>
      <translation>eine Last</translation>
    </message>
    <message>
      <source>The program michell_cad, which computes the truss, was not found.

Tried: {python}
{said}
Install it once, in a Python (3.11 or newer) of its own:
    {install}
then name that Python (here: michell/bin/python) under Edit &gt; Preferences &gt; Michell, or run
    michell-cad plugin install freecad
which does so for you.</source>
      <translation>Das Programm michell_cad, das das Fachwerk berechnet, wurde nicht gefunden.

Versucht: {python}
{said}
Einmal installieren, in einem eigenen Python (3.11 oder neuer):
    {install}
und dieses Python (hier: michell/bin/python) unter Bearbeiten &gt; Einstellungen &gt; Michell nennen, oder
    michell-cad plugin install freecad
ausführen, was das erledigt.</translation>
    </message>
    <message>
      <source>The computation stopped unexpectedly (exit code {code}). Nothing in the document was changed.

Try again; if it stops again, memory may be short: choose a smaller resolution or a larger mesh size.
{said}</source>
      <translation>Die Berechnung ist unerwartet abgebrochen (Endcode {code}). Im Dokument wurde nichts geändert.

Noch einmal versuchen; bricht sie wieder ab, ist vielleicht der Speicher knapp: eine kleinere Auflösung oder eine größere Netzweite wählen.
{said}</translation>
    </message>
    <message>
      <source>Cancelled. The document is as it was.</source>
      <translation>Abgebrochen. Das Dokument ist, wie es war.</translation>
    </message>
    <message>
      <source>michell_cad is still computing another truss: wait until it is done, or cancel it.</source>
      <translation>michell_cad berechnet noch ein anderes Fachwerk: warten, bis es fertig ist, oder jenes abbrechen.</translation>
    </message>
    <message>
      <source>The body {body} has been edited, and these faces are no longer there:
{places}

Open the truss (double click), pick the faces again, and compute.</source>
      <translation>Der Körper {body} wurde bearbeitet, und diese Flächen gibt es nicht mehr:
{places}

Das Fachwerk öffnen (Doppelklick), die Flächen neu wählen und berechnen.</translation>
    </message>
    <message>
      <source>The body {body} has changed since this truss was computed. Double click on the truss and compute again.</source>
      <translation>Der Körper {body} hat sich geändert, seit dieses Fachwerk berechnet wurde. Doppelklick auf das Fachwerk, und neu berechnen.</translation>
    </message>
    <message>
      <source>The body of this truss is no longer in the document. Its knobs still work; to compute it again, make a new truss from another body.</source>
      <translation>Der Körper dieses Fachwerks ist nicht mehr im Dokument. Seine Regler wirken weiterhin; um neu zu rechnen, ein neues Fachwerk aus einem anderen Körper machen.</translation>
    </message>
    <message>
      <source>The design of this truss is not in the document (it is stored inside the .FCStd file when the document is saved). Double click on the truss and compute again.</source>
      <translation>Der Entwurf dieses Fachwerks ist nicht im Dokument (er wird beim Speichern in der .FCStd-Datei abgelegt). Doppelklick auf das Fachwerk, und neu berechnen.</translation>
    </message>
    <message>
      <source>This truss was saved by a newer add-in (version {found}; this one reads up to {known}). Its shape stays as it is. To change it, install a newer michell_cad and run: michell-cad plugin install freecad</source>
      <translation>Dieses Fachwerk wurde von einem neueren Zusatz gespeichert (Fassung {found}; dieser liest bis {known}). Seine Form bleibt, wie sie ist. Um es zu ändern, ein neueres michell_cad installieren und ausführen: michell-cad plugin install freecad</translation>
    </message>
    <message>
      <source>The document {name} has not been saved yet. Save it to keep the truss: its design is stored inside the document, so that the knobs work without computing again.</source>
      <translation>Das Dokument {name} ist noch nicht gespeichert. Speichern, um das Fachwerk zu behalten: Sein Entwurf liegt im Dokument, damit die Regler ohne neue Berechnung wirken.</translation>
    </message>
    <message>
      <source>Select one or more faces of the body in the 3-D view first, then press the button for {what}.</source>
      <translation>Zuerst eine oder mehrere Flächen des Körpers in der 3D-Ansicht wählen, dann den Knopf für {what} drücken.</translation>
    </message>
    <message>
      <source>The faces belong to {first} and to {second}: a truss is made of one body. Pick faces of {first}.</source>
      <translation>Die Flächen gehören zu {first} und zu {second}: Ein Fachwerk wird aus einem Körper gemacht. Flächen von {first} wählen.</translation>
    </message>
    <message>
      <source>Before computing, give: {missing}.</source>
      <translation>Vor dem Berechnen angeben: {missing}.</translation>
    </message>
    <message>
      <source>{body} holds {solids} solids; a truss is made of exactly one. Unite them (Part &gt; Boolean &gt; Union), or pick faces of a single solid.</source>
      <translation>{body} enthält {solids} Volumenkörper; ein Fachwerk wird aus genau einem gemacht. Sie vereinigen (Part &gt; Boolesche Verknüpfung &gt; Vereinigung), oder Flächen eines einzelnen wählen.</translation>
    </message>
    <message>
      <source>Select a Michell truss in the tree first.</source>
      <translation>Zuerst ein Michell-Fachwerk im Baum wählen.</translation>
    </message>
    <message>
      <source>Select faces of a body and add them below.</source>
      <translation>Flächen eines Körpers wählen und unten hinzufügen.</translation>
    </message>
    <message>
      <source>whole body</source>
      <translation>ganzer Körper</translation>
    </message>
    <message>
      <source>Another form is open: close it first.</source>
      <translation>Ein anderes Formular ist offen: zuerst schließen.</translation>
    </message>
    <message>
      <source>Compute truss</source>
      <translation>Fachwerk berechnen</translation>
    </message>
    <message>
      <source>Compute the truss of the body; the document changes only when all is done</source>
      <translation>Das Fachwerk des Körpers berechnen; das Dokument ändert sich erst, wenn alles fertig ist</translation>
    </message>
    <message>
      <source>Cancel</source>
      <translation>Abbrechen</translation>
    </message>
    <message>
      <source>Stop computing; the document stays as it is</source>
      <translation>Berechnung anhalten; das Dokument bleibt, wie es ist</translation>
    </message>
    <message>
      <source>Write a job file and the body beside it, for: michell-cad design JOB.toml</source>
      <translation>Eine Auftragsdatei und den Körper daneben schreiben, für: michell-cad design JOB.toml</translation>
    </message>
    <message>
      <source>Supports</source>
      <translation>Lager</translation>
    </message>
    <message>
      <source>Axes of the document along which the faces cannot move</source>
      <translation>Achsen des Dokuments, entlang derer sich die Flächen nicht bewegen können</translation>
    </message>
    <message>
      <source>Loads</source>
      <translation>Lasten</translation>
    </message>
    <message>
      <source>force, N</source>
      <translation>Kraft, N</translation>
    </message>
    <message>
      <source>pressure, MPa</source>
      <translation>Druck, MPa</translation>
    </message>
    <message>
      <source>torque, N mm, axis</source>
      <translation>Drehmoment, N mm, Achse</translation>
    </message>
    <message>
      <source>own weight, direction</source>
      <translation>Eigengewicht, Richtung</translation>
    </message>
    <message>
      <source>Name of the load case; loads of the same case act together</source>
      <translation>Name des Lastfalls; Lasten desselben Falls wirken gemeinsam</translation>
    </message>
    <message>
      <source>supports</source>
      <translation>Lager</translation>
    </message>
    <message>
      <source>Add selected faces</source>
      <translation>Gewählte Flächen hinzufügen</translation>
    </message>
    <message>
      <source>Hold the faces that are selected in the 3-D view</source>
      <translation>Die in der 3D-Ansicht gewählten Flächen festhalten</translation>
    </message>
    <message>
      <source>Remove the marked support</source>
      <translation>Das markierte Lager entfernen</translation>
    </message>
    <message>
      <source>Load the faces that are selected in the 3-D view</source>
      <translation>Die in der 3D-Ansicht gewählten Flächen belasten</translation>
    </message>
    <message>
      <source>Remove the marked load</source>
      <translation>Die markierte Last entfernen</translation>
    </message>
    <message>
      <source>Material</source>
      <translation>Werkstoff</translation>
    </message>
    <message>
      <source>Material of the body</source>
      <translation>Werkstoff des Körpers</translation>
    </message>
    <message>
      <source>Resolution</source>
      <translation>Auflösung</translation>
    </message>
    <message>
      <source>Cells of the truss along the body</source>
      <translation>Zellen des Fachwerks entlang des Körpers</translation>
    </message>
    <message>
      <source>or cell edge, mm</source>
      <translation>oder Zellkante, mm</translation>
    </message>
    <message>
      <source>Instead of a resolution; 0: by the resolution</source>
      <translation>Statt einer Auflösung; 0: nach der Auflösung</translation>
    </message>
    <message>
      <source>Mesh size, mm</source>
      <translation>Netzweite, mm</translation>
    </message>
    <message>
      <source>Edge of the tetrahedra for the stress; 0: from the body</source>
      <translation>Kante der Tetraeder für die Spannungen; 0: nach dem Körper</translation>
    </message>
    <message>
      <source>loads</source>
      <translation>Lasten</translation>
    </message>
    <message>
      <source>Body: {name}</source>
      <translation>Körper: {name}</translation>
    </message>
    <message>
      <source>a body</source>
      <translation>einen Körper</translation>
    </message>
    <message>
      <source>up to date</source>
      <translation>auf dem neuesten Stand</translation>
    </message>
    <message>
      <source>Building the truss...</source>
      <translation>Das Fachwerk wird gebaut...</translation>
    </message>
  </context>
  <context>
    <name>App::Property</name>
    <message>
      <source>Smallest radius of a member</source>
      <translation>Kleinster Radius eines Stabes</translation>
    </message>
    <message>
      <source>Edge of a typical cell</source>
      <translation>Kante einer typischen Zelle</translation>
    </message>
    <message>
      <source>Volume of the truss, mm^3, as michell_cad measures it</source>
      <translation>Volumen des Fachwerks, mm^3, wie michell_cad es misst</translation>
    </message>
    <message>
      <source>Mass of the truss, g</source>
      <translation>Masse des Fachwerks, g</translation>
    </message>
    <message>
      <source>What michell_cad says about this truss</source>
      <translation>Was michell_cad zu diesem Fachwerk sagt</translation>
    </message>
    <message>
      <source>The body that the truss is made of</source>
      <translation>Der Körper, aus dem das Fachwerk gemacht ist</translation>
    </message>
    <message>
      <source>Families of curves to build; boundary curves go with their family, sharp edges stay.</source>
      <translation>Scharen von Kurven, die gebaut werden; Randkurven gehen mit ihrer Schar, scharfe Kanten bleiben.</translation>
    </message>
    <message>
      <source>Radius of the members; default: 0.08 of the cell edge. [mm] 0: not set.</source>
      <translation>Radius der Stäbe; ohne Angabe: 0,08 der Zellkante. [mm] 0: nicht gesetzt.</translation>
    </message>
    <message>
      <source>Instead of a radius: volume of the truss over volume of the part. 0: not set.</source>
      <translation>Statt eines Radius: Volumen des Fachwerks durch Volumen des Teils. 0: nicht gesetzt.</translation>
    </message>
    <message>
      <source>Instead of a radius: mass of the truss. [g] 0: not set.</source>
      <translation>Statt eines Radius: Masse des Fachwerks. [g] 0: nicht gesetzt.</translation>
    </message>
    <message>
      <source>No member is thinner than this, whatever else says so: what the printer can make. [mm]</source>
      <translation>Kein Stab ist dünner als dies, was auch immer sonst gilt: was der Drucker kann. [mm]</translation>
    </message>
    <message>
      <source>Members are thicker by this fraction in the middle of each curve.</source>
      <translation>Um diesen Anteil sind Stäbe in der Mitte jeder Kurve dicker.</translation>
    </message>
    <message>
      <source>Density: keep every n-th curve; one number, or one each for tension, compression and third.</source>
      <translation>Dichte: jede n-te Kurve behalten; eine Zahl, oder je eine für Zug, Druck und die dritte Schar.</translation>
    </message>
    <message>
      <source>Every for tension alone; 0: as Every. Density: keep every n-th curve; one number, or one each for tension, compression and third.</source>
      <translation>Every für Zug allein; 0: wie Every. Dichte: jede n-te Kurve behalten; eine Zahl, oder je eine für Zug, Druck und die dritte Schar.</translation>
    </message>
    <message>
      <source>Every for compression alone; 0: as Every. Density: keep every n-th curve; one number, or one each for tension, compression and third.</source>
      <translation>Every für Druck allein; 0: wie Every. Dichte: jede n-te Kurve behalten; eine Zahl, oder je eine für Zug, Druck und die dritte Schar.</translation>
    </message>
    <message>
      <source>Every for third alone; 0: as Every. Density: keep every n-th curve; one number, or one each for tension, compression and third.</source>
      <translation>Every für die dritte Schar allein; 0: wie Every. Dichte: jede n-te Kurve behalten; eine Zahl, oder je eine für Zug, Druck und die dritte Schar.</translation>
    </message>
    <message>
      <source>Which of the n curves to keep: those whose isovalue plus offset is a multiple of n.</source>
      <translation>Welche der n Kurven bleiben: jene, deren Isowert plus Versatz ein Vielfaches von n ist.</translation>
    </message>
    <message>
      <source>Offset for tension alone; -1: as Offset. Which of the n curves to keep: those whose isovalue plus offset is a multiple of n.</source>
      <translation>Offset für Zug allein; -1: wie Offset. Welche der n Kurven bleiben: jene, deren Isowert plus Versatz ein Vielfaches von n ist.</translation>
    </message>
    <message>
      <source>Offset for compression alone; -1: as Offset. Which of the n curves to keep: those whose isovalue plus offset is a multiple of n.</source>
      <translation>Offset für Druck allein; -1: wie Offset. Welche der n Kurven bleiben: jene, deren Isowert plus Versatz ein Vielfaches von n ist.</translation>
    </message>
    <message>
      <source>Offset for third alone; -1: as Offset. Which of the n curves to keep: those whose isovalue plus offset is a multiple of n.</source>
      <translation>Offset für die dritte Schar allein; -1: wie Offset. Welche der n Kurven bleiben: jene, deren Isowert plus Versatz ein Vielfaches von n ist.</translation>
    </message>
    <message>
      <source>Smallest radius of a node over the radius of its members; tight nodes take more.</source>
      <translation>Kleinster Radius eines Knotens durch den Radius seiner Stäbe; enge Knoten brauchen mehr.</translation>
    </message>
    <message>
      <source>Radius of the fillet between node and member over the radius of the member; 0: no fillets.</source>
      <translation>Radius der Ausrundung zwischen Knoten und Stab durch den Radius des Stabes; 0: keine Ausrundungen.</translation>
    </message>
    <message>
      <source>Cross-section of the members, of the area of the circle of the radius; or the points (x, y) of an outline of one's own, as read from a .dxf, .svg, .step or .brep file if the name of one is given.</source>
      <translation>Querschnitt der Stäbe, so groß wie der Kreis mit dem Radius; oder die Punkte (x, y) eines eigenen Umrisses, gelesen aus einer Datei .dxf, .svg, .step oder .brep, wenn deren Name angegeben ist.</translation>
    </message>
    <message>
      <source>Stretches the profile along its x axis, which points along the curves of the next family: a square of 2 is a rectangle twice as long as wide. The area stays.</source>
      <translation>Streckt das Profil entlang seiner x-Achse, die entlang der Kurven der nächsten Familie zeigt: ein Quadrat mit 2 ist ein Rechteck, doppelt so lang wie breit. Die Fläche bleibt.</translation>
    </message>
    <message>
      <source>Nodes as spheres, or as convex hulls of the profiles that meet; hulls have no fillets, like all nodes of profiles that are not round.</source>
      <translation>Knoten als Kugeln oder als konvexe Hüllen der Profile, die dort zusammentreffen; Hüllen haben keine Ausrundungen, ebenso wie alle Knoten nicht runder Profile.</translation>
    </message>
  </context>
  <context>
    <name>MichellPreferences</name>
    <message>
      <source>Michell trusses</source>
      <translation>Michell-Fachwerke</translation>
    </message>
    <message>
      <source>Python in which michell_cad is installed (empty: as "michell-cad plugin install freecad" noted it):</source>
      <translation>Python, in dem michell_cad installiert ist (leer: wie „michell-cad plugin install freecad“ es vermerkt hat):</translation>
    </message>
    <message>
      <source>For example /home/me/michell/bin/python; FreeCAD's own Python is another one</source>
      <translation>Zum Beispiel /home/ich/michell/bin/python; das Python von FreeCAD selbst ist ein anderes</translation>
    </message>
  </context>
</TS>
